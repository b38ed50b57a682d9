# One room is one static library with its warnings and its tests.
#
#   engine_room(render SOURCES forward.cc ... USES scene core LINKS hwy::hwy
#               TESTS project_test.cc GOLDEN_TESTS ... SLOW_TESTS ... SERVED_TESTS ...)
#
# USES are the room's arrows: the only rooms whose headers it may include (tests/house holds the #include lines
# against them). LINKS are third-party libraries. Tests live in tests/<folder>/ and carry the label of their list:
# unit (milliseconds each), golden (reference vectors and real captures), slow, served (by a PostgreSQL server that the
# program starts: one process for all of its tests). Their names begin with the folder. The target all_LABEL builds all
# programs of a label. TEST_ENVIRONMENT are variables, NAME=VALUE, that they run with.

add_library(splatdrag_warnings INTERFACE)
target_compile_options(splatdrag_warnings INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor
                       -Wimplicit-fallthrough -Wno-unknown-pragmas)
# The fuzz targets are built by another compiler, whose warnings nobody keeps to.
if(NOT SPLATDRAG_FUZZ)
  target_compile_options(splatdrag_warnings INTERFACE -Werror)
endif()
# GCC 12 warns of an overlap in `"text" + std::string` that cannot happen (its bug 105651).
target_compile_options(splatdrag_warnings INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>)
# -ffp-contract=off: whether a*b+c is fused must be written in the source, not left to the compiler, or the bytes of a
# result would change with the optimiser. Fused operations are asked for by name (Highway's MulAdd).
target_compile_options(splatdrag_warnings INTERFACE -ffp-contract=off -fno-math-errno)
if(SPLATDRAG_SANITIZE)
  add_compile_options(-fsanitize=${SPLATDRAG_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  add_link_options(-fsanitize=${SPLATDRAG_SANITIZE})
endif()

# How tests are compiled, which run about once for each time that they are: so that compiling takes little. What a test
# brings of the rooms' headers that is not inlined is compiled so, too; -ffp-contract=off keeps results as they are.
add_library(splatdrag_test_options INTERFACE)
target_link_libraries(splatdrag_test_options INTERFACE splatdrag_warnings)
target_compile_options(splatdrag_test_options INTERFACE $<$<CONFIG:Release>:-O1>)
if(SPLATDRAG_SANITIZE)
  # These of UBSan's checks take two fifths of a test's compile time, and find what AddressSanitizer finds, too, or what
  # the room's own sources are checked for.
  target_compile_options(splatdrag_test_options INTERFACE -fno-sanitize=null,alignment,object-size,vptr)
endif()
# Without it ccache does not tell one precompiled header from another, and compiles anew.
target_compile_options(splatdrag_test_options INTERFACE $<$<CXX_COMPILER_ID:GNU>:-fpch-preprocess>)

set_property(GLOBAL PROPERTY SPLATDRAG_ARROWS "")

function(splatdrag_tests target label folder library)
  if(NOT SPLATDRAG_TESTS OR NOT ARGN)
    return()
  endif()
  list(TRANSFORM ARGN PREPEND ${CMAKE_SOURCE_DIR}/tests/${folder}/)
  add_executable(${target} ${ARGN})
  target_link_libraries(${target} PRIVATE ${library} splatdrag_test_support splatdrag_test_options GTest::gtest_main)
  # libtorch's users define which of two layouts the standard library's strings have, be it the one that they have anyway:
  # GCC then takes no header that was compiled without.
  if(NOT SPLATDRAG_DIFFUSION OR NOT folder MATCHES "^(engine/diffusion|server/)")
    target_precompile_headers(${target} REUSE_FROM splatdrag_test_headers)
  endif()
  if(NOT TARGET all_${label})
    add_custom_target(all_${label})
  endif()
  add_dependencies(all_${label} ${target})
  if(SPLATDRAG_SANITIZE OR label STREQUAL "served")
    # To start a program under a sanitizer takes longer than most tests do: one process for all of a program's. Those of
    # repair and edit take half an hour on a machine that others use.
    set(patience 1800)
    if(SPLATDRAG_SANITIZE)
      set(patience 3600)
    endif()
    add_test(NAME ${folder}/${label} COMMAND ${target})
    set_tests_properties(${folder}/${label} PROPERTIES LABELS ${label} TIMEOUT ${patience})
    if(ROOM_TEST_ENVIRONMENT)
      set_tests_properties(${folder}/${label} PROPERTIES ENVIRONMENT "${ROOM_TEST_ENVIRONMENT}")
    endif()
  else()
    include(GoogleTest)
    # An empty value would be dropped on its way to the tests, and its name with the next value taken for a pair. Of several
    # variables the semicolons must get through: the list is taken apart once more where tests are discovered.
    set(environment "")
    if(ROOM_TEST_ENVIRONMENT)
      string(REPLACE ";" "\\;" environment "${ROOM_TEST_ENVIRONMENT}")
      set(environment ENVIRONMENT "${environment}")
    endif()
    gtest_discover_tests(${target} TEST_PREFIX ${folder}/ DISCOVERY_TIMEOUT 60
                         PROPERTIES LABELS ${label} TIMEOUT 900 ${environment})
  endif()
endfunction()

function(splatdrag_room kind folder name)
  cmake_parse_arguments(ROOM "" "" "SOURCES;USES;LINKS;TEST_LINKS;TEST_ENVIRONMENT;TESTS;GOLDEN_TESTS;SLOW_TESTS;SERVED_TESTS" ${ARGN})
  if(ROOM_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "room ${name}: unknown arguments ${ROOM_UNPARSED_ARGUMENTS}")
  endif()
  add_library(${name} STATIC ${ROOM_SOURCES})
  target_include_directories(${name} PUBLIC ${CMAKE_SOURCE_DIR})
  target_link_libraries(${name} PRIVATE splatdrag_warnings PUBLIC ${ROOM_LINKS})
  foreach(used ${ROOM_USES})
    target_link_libraries(${name} PUBLIC ${used})
  endforeach()
  string(REPLACE ";" " " arrows "${ROOM_USES}")
  set_property(GLOBAL APPEND_STRING PROPERTY SPLATDRAG_ARROWS "${folder}: ${arrows}\n")
  add_library(${name}_test_deps INTERFACE)
  target_link_libraries(${name}_test_deps INTERFACE ${name} ${ROOM_TEST_LINKS})
  splatdrag_tests(${name}_test unit ${folder} ${name}_test_deps ${ROOM_TESTS})
  splatdrag_tests(${name}_golden_test golden ${folder} ${name}_test_deps ${ROOM_GOLDEN_TESTS})
  splatdrag_tests(${name}_slow_test slow ${folder} ${name}_test_deps ${ROOM_SLOW_TESTS})
  splatdrag_tests(${name}_served_test served ${folder} ${name}_test_deps ${ROOM_SERVED_TESTS})
  if(TARGET ${name}_served_test)
    target_link_libraries(${name}_served_test PRIVATE splatdrag_postgres_server)
  endif()
endfunction()

function(engine_room name)
  cmake_parse_arguments(ROOM "" "" "SOURCES;USES;LINKS;TEST_LINKS;TEST_ENVIRONMENT;TESTS;GOLDEN_TESTS;SLOW_TESTS;SERVED_TESTS" ${ARGN})
  list(TRANSFORM ROOM_USES PREPEND engine_)
  splatdrag_room(engine engine/${name} engine_${name} SOURCES ${ROOM_SOURCES} USES ${ROOM_USES} LINKS ${ROOM_LINKS}
                 TEST_LINKS ${ROOM_TEST_LINKS} TEST_ENVIRONMENT ${ROOM_TEST_ENVIRONMENT} TESTS ${ROOM_TESTS} GOLDEN_TESTS ${ROOM_GOLDEN_TESTS}
                 SLOW_TESTS ${ROOM_SLOW_TESTS} SERVED_TESTS ${ROOM_SERVED_TESTS})
endfunction()
