# A second build of the same sources should cost seconds: ccache where it is installed.
find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM)
  # It keeps what is compiled with a precompiled header only where it need not look for __DATE__ and its like, which no
  # source of ours has, nor for macros that differ from those of the header, which the compiler refuses.
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${CCACHE_PROGRAM})
endif()
