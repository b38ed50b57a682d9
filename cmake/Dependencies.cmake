# Every third-party library, in one place. All are Debian 12 packages; the version is the least we accept.
find_package(Threads REQUIRED)
find_package(glm 0.9.9 REQUIRED)             # vectors, matrices, quaternions
find_package(TBB 2021 REQUIRED)              # threads
find_package(hwy 1.0 REQUIRED)               # SIMD
find_package(OpenImageIO 2.4 REQUIRED)       # image files, resizing
# Debian's package names OpenCV's headers, which its own headers need only for a conversion we do not use, and which
# need not be installed; CMake refuses a folder that does not exist.
set_target_properties(OpenImageIO::OpenImageIO PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${OpenImageIO_INCLUDE_DIR}"
                      INTERFACE_SYSTEM_INCLUDE_DIRECTORIES "")
# FLANN's trees are templates: its headers are all we need, and lz4, which they name. (Debian's pkg-config file asks for
# an MPI that nothing here uses.)
find_path(FLANN_INCLUDE_DIR flann/algorithms/kdtree_single_index.h REQUIRED)
find_library(LZ4_LIBRARY lz4 REQUIRED)
add_library(FLANN::FLANN INTERFACE IMPORTED)
set_target_properties(FLANN::FLANN PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${FLANN_INCLUDE_DIR}"
                      INTERFACE_LINK_LIBRARIES "${LZ4_LIBRARY}")
find_package(Eigen3 3.4 REQUIRED NO_MODULE)  # equations, sparse and small
find_package(ZLIB REQUIRED)                  # spz versions 1 to 3
find_package(zstd REQUIRED)                  # spz version 4
find_package(SQLite3 3.38 REQUIRED)          # job records
find_package(nlohmann_json 3.11 REQUIRED)    # JSON
find_package(tomlplusplus 3.3 REQUIRED)      # settings file
find_package(CLI11 2.1 REQUIRED)             # command line
find_package(tl-expected REQUIRED)           # Result
find_package(spdlog 1.10 REQUIRED)           # logs
find_package(prometheus-cpp REQUIRED)        # metrics (its package states no version)
# HTTP. Debian compiles the library; pkg-config knows the definitions it was compiled with, which change its classes.
find_package(PkgConfig REQUIRED)
pkg_check_modules(httplib REQUIRED IMPORTED_TARGET cpp-httplib>=0.11)
# Scenes in SOG, and datasets sent as zip files. Debian's CMake package also wants libzip's programs installed; pkg-config does not.
pkg_check_modules(libzip REQUIRED IMPORTED_TARGET libzip>=1.7)
pkg_check_modules(libwebp REQUIRED IMPORTED_TARGET libwebp>=1.2)  # SOG's pictures, to the bit
pkg_check_modules(libpq REQUIRED IMPORTED_TARGET libpq>=14)       # job records that many hosts share
# Checksums of stored files. XXH3's output is fixed since 0.8.0.
pkg_check_modules(libxxhash REQUIRED IMPORTED_TARGET libxxhash>=0.8)
# Networks, for correction by a diffusion model (engine/diffusion): where both are found. Debian's libtorch, or another
# build of it that CMAKE_PREFIX_PATH leads to; and of Unicode what a prompt needs. Off, nobody looks for them: the package of
# a libtorch whose own libraries are missing (one for CUDA without its toolkit) ends CMake, and QUIET does not keep it from that.
option(SPLATDRAG_DIFFUSION "Diffusion models, where libtorch and utf8proc are found" ON)
if(SPLATDRAG_DIFFUSION)
  find_package(Torch 1.13 QUIET)
  pkg_check_modules(libutf8proc QUIET IMPORTED_TARGET libutf8proc>=2.6)  # what 2.8's file says it is
  if(NOT Torch_FOUND OR NOT libutf8proc_FOUND)
    set(SPLATDRAG_DIFFUSION OFF)
  endif()
endif()
message(STATUS "Diffusion models (libtorch-dev, libutf8proc-dev): ${SPLATDRAG_DIFFUSION}")
if(SPLATDRAG_TESTS)
  find_package(GTest 1.12 REQUIRED)
endif()
if(SPLATDRAG_BENCHMARKS)
  find_package(benchmark 1.7 REQUIRED)
endif()
