# The install tree: libraries, public headers, the program, and a package other projects can find.
# Component `program` is what users run (with the Python package), `development` what others link.
include(CMakePackageConfigHelpers)
include(GNUInstallDirs)

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/trochoid)
set(TROCHOID_COMPONENTS data model fitting)
if(TROCHOID_TRACKING)
  list(APPEND TROCHOID_COMPONENTS tracking)
endif()
foreach(component IN LISTS TROCHOID_COMPONENTS)
  install(TARGETS trochoid_${component} EXPORT trochoid
    ARCHIVE COMPONENT development FILE_SET HEADERS COMPONENT development)
endforeach()
install(TARGETS trochoid COMPONENT program)
install(EXPORT trochoid NAMESPACE trochoid:: FILE trochoidTargets.cmake
  DESTINATION ${package_dir} COMPONENT development)
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/trochoidConfig.cmake.in
  ${CMAKE_BINARY_DIR}/trochoidConfig.cmake INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${CMAKE_BINARY_DIR}/trochoidConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/trochoidConfig.cmake
              ${CMAKE_BINARY_DIR}/trochoidConfigVersion.cmake
        DESTINATION ${package_dir} COMPONENT development)

# Below share/doc as below the source folder: what headers and pages cite is found under the name they use.
install(FILES ${CMAKE_SOURCE_DIR}/README.md DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT program)
install(DIRECTORY ${CMAKE_SOURCE_DIR}/docs DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT program)
install(FILES ${CMAKE_SOURCE_DIR}/docs/formats.md ${CMAKE_SOURCE_DIR}/docs/library.md
        DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/doc/libtrochoid-dev/docs COMPONENT development)
install(DIRECTORY ${CMAKE_SOURCE_DIR}/model/theory
        DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/doc/libtrochoid-dev/model COMPONENT development)
