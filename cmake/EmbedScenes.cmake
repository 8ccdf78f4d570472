# Writes OUTPUT, a source file that holds every scene of FOLDER:
#   cmake -DFOLDER=data/scenes -DOUTPUT=scenes.cpp -P EmbedScenes.cmake
file(GLOB scenes ${FOLDER}/*.toml)
list(SORT scenes)
set(entries "")
foreach(scene IN LISTS scenes)
  get_filename_component(name ${scene} NAME_WLE)
  file(READ ${scene} text)
  string(APPEND entries "      {\"${name}\", R\"TOML(${text})TOML\"},\n")
endforeach()
file(WRITE ${OUTPUT} "#include \"common/scene_library.hpp\"

namespace trochoid::tools {

const std::vector<BundledScene>& bundled_scenes() {
  static const std::vector<BundledScene> scenes{
${entries}  };
  return scenes;
}

}  // namespace trochoid::tools
")
