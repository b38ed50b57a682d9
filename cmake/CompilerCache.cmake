# A second build of the same sources should cost seconds: ccache where it is installed.
find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM)
  # What is compiled with a precompiled header is kept only where that is asked for: no source of ours says when it was
  # compiled, which is what these two might get wrong.
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${CCACHE_PROGRAM})
endif()
