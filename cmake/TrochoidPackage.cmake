# Debian packages by CPack (`tools/package`): trochoid (program, man pages, completion, Python package) and
# libtrochoid-dev (headers, static libraries, CMake package). The version is project(VERSION) alone.
set(doc_dir share/doc)
string(TIMESTAMP TROCHOID_PACKAGE_DATE "%a, %d %b %Y %H:%M:%S +0000" UTC)  # SOURCE_DATE_EPOCH if set
set(TROCHOID_MAINTAINER "trochoid authors <trochoid@localhost>" CACHE STRING "Maintainer of the Debian packages")
set(staged ${CMAKE_BINARY_DIR}/debian)
configure_file(${CMAKE_CURRENT_LIST_DIR}/debian/changelog.in ${staged}/changelog.Debian @ONLY)
configure_file(${CMAKE_CURRENT_LIST_DIR}/debian/copyright.in ${staged}/copyright @ONLY)
configure_file(${CMAKE_SOURCE_DIR}/CHANGELOG.md ${staged}/changelog COPYONLY)
find_program(GZIP gzip REQUIRED)
execute_process(COMMAND ${GZIP} -9nkf changelog.Debian changelog WORKING_DIRECTORY ${staged}
                COMMAND_ERROR_IS_FATAL ANY)
foreach(part program:trochoid development:libtrochoid-dev)
  string(REPLACE ":" ";" part ${part})
  list(GET part 0 component)
  list(GET part 1 package)
  install(FILES ${staged}/copyright ${staged}/changelog.gz ${staged}/changelog.Debian.gz
          DESTINATION ${doc_dir}/${package} COMPONENT ${component})
endforeach()

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_PACKAGE_CONTACT ${TROCHOID_MAINTAINER})
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_COMPONENTS_ALL program development)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME trochoid)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION science)
# The first line of a Debian description, the synopsis, is the project's.
set(CPACK_DEBIAN_PROGRAM_DESCRIPTION "Follows the centre of mass of a coin, disc or ring in a top-view recording,
tells which rigid-body model explains its path, with which parameters and
error bars, and draws prediction and observation into the video. With a
Python package of the same functions.")
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_DEPENDS "ffmpeg")
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SUGGESTS "gnuplot-nox, libtrochoid-dev")
if(TROCHOID_PYTHON)
  # The compiled half belongs to one minor version of Python.
  math(EXPR next "${Python_VERSION_MINOR} + 1")
  string(APPEND CPACK_DEBIAN_PROGRAM_PACKAGE_DEPENDS
    ", python3 (>= 3.${Python_VERSION_MINOR}~), python3 (<< 3.${next}), python3-numpy")
endif()

set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libtrochoid-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_DESCRIPTION "Headers and static libraries: models of spinning and rolling bodies, their
integrators, the tracker and the fit, for
find_package(trochoid COMPONENTS data model fitting tracking).")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
  "libeigen3-dev, libfmt-dev, nlohmann-json3-dev, libtomlplusplus-dev, libssl-dev, libsundials-dev, libceres-dev")
if(TROCHOID_TRACKING)
  string(APPEND CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
    ", libopencv-dev, libavformat-dev, libavcodec-dev, libavutil-dev, libswscale-dev, pkg-config")
endif()
include(CPack)
