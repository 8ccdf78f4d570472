# What every target of the project shares: warnings, sanitizers, and the shape of a module.

add_library(trochoid_warnings INTERFACE)
target_compile_options(trochoid_warnings INTERFACE
  -Wall -Wextra -Wpedantic -Wconversion -Wno-sign-conversion -Wnon-virtual-dtor -Wno-psabi
  $<$<BOOL:${TROCHOID_WERROR}>:-Werror>)
if(NOT CMAKE_UNITY_BUILD)
  target_compile_options(trochoid_warnings INTERFACE -Wshadow)
elseif(CMAKE_CXX_COMPILER_ID STREQUAL GNU)  # a local may have the name of another file's constant
  target_compile_options(trochoid_warnings INTERFACE -Wshadow=local)
endif()
if(TROCHOID_SANITIZE)
  target_compile_options(trochoid_warnings INTERFACE
    -fsanitize=${TROCHOID_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all
    # GCC 12 warns falsely about its own <regex> once the sanitizers have changed its inlining.
    $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
  if(TROCHOID_SANITIZE MATCHES undefined)
    # They double the compile time and tell little that the address sanitizer does not; the last one
    # objects to Eigen's empty blocks.
    target_compile_options(trochoid_warnings INTERFACE
      -fno-sanitize=null,alignment,object-size,vptr,pointer-overflow)
  endif()
  target_link_options(trochoid_warnings INTERFACE -fsanitize=${TROCHOID_SANITIZE})
endif()

# trochoid_compiles_slowly(TARGET): for formulas of which the address sanitizer makes more code than runs: it calls
# its check at each access instead of spelling it out, which compiles by a third faster and runs slower.
function(trochoid_compiles_slowly target)
  if(TROCHOID_SANITIZE MATCHES address AND CMAKE_CXX_COMPILER_ID MATCHES Clang)
    target_compile_options(${target} PRIVATE "SHELL:-mllvm -asan-instrumentation-with-call-threshold=0")
  endif()
endfunction()

# trochoid_module(NAME): library trochoid::NAME from NAME/src/*.cpp with public headers below
# NAME/include. Sources are globbed: a file in the folder is a file of the module.
function(trochoid_module name)
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/src/*.cpp)
  file(GLOB_RECURSE headers CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/include/*.hpp)
  add_library(trochoid_${name} STATIC ${sources})
  add_library(trochoid::${name} ALIAS trochoid_${name})
  target_sources(trochoid_${name} PUBLIC FILE_SET HEADERS
    BASE_DIRS ${CMAKE_CURRENT_SOURCE_DIR}/include FILES ${headers})
  target_include_directories(trochoid_${name} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/src)
  target_compile_features(trochoid_${name} PUBLIC cxx_std_20)
  target_link_libraries(trochoid_${name} PRIVATE $<BUILD_INTERFACE:trochoid_warnings>)
  set_target_properties(trochoid_${name} PROPERTIES
    EXPORT_NAME ${name} VERIFY_INTERFACE_HEADER_SETS ON POSITION_INDEPENDENT_CODE ON)
endfunction()
