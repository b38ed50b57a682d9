# Files inside a program, so that it needs none beside it.
#
#   splatdrag_embed(server_service page_files ${CMAKE_SOURCE_DIR}/web index.html main.js ...)
#
# adds to the target a source that defines server::service::page_files() (declared in server/service/embedded_files.h): the files below
# the folder, by the names given, with their bytes, and these once more as gzip, which most clients take. The assembler
# copies the bytes, so that even large files compile at once; a file that changes is copied anew.
find_program(SPLATDRAG_GZIP gzip REQUIRED)
function(splatdrag_embed target function folder)
  set(source ${CMAKE_CURRENT_BINARY_DIR}/embedded_${function}.cc)
  set(symbols "")
  set(declarations "")
  set(entries "")
  set(paths "")
  set(number 0)
  foreach(name ${ARGN})
    set(symbol splatdrag_embedded_${function}_${number})
    set(packed ${CMAKE_CURRENT_BINARY_DIR}/${function}/${name}.gz)
    get_filename_component(packed_folder ${packed} DIRECTORY)
    file(MAKE_DIRECTORY ${packed_folder})
    # Without name and time (-n): the same bytes give the same bytes.
    add_custom_command(OUTPUT ${packed} COMMAND ${SPLATDRAG_GZIP} -9 -n -c ${folder}/${name} > ${packed}
                       DEPENDS ${folder}/${name} VERBATIM)
    set(both "")
    foreach(file ${folder}/${name} ${packed})
      string(APPEND symbols "    \"${symbol}:\\n.incbin \\\"${file}\\\"\\n${symbol}_end:\\n.byte 0\\n\"\n")
      string(APPEND declarations "extern const char ${symbol}[], ${symbol}_end[];\n")
      string(APPEND both ", {${symbol}, std::size_t(${symbol}_end - ${symbol})}")
      list(APPEND paths ${file})
      string(APPEND symbol _gzip)
    endforeach()
    string(APPEND entries "      {\"${name}\"${both}},\n")
    target_sources(${target} PRIVATE ${packed})
    math(EXPR number "${number} + 1")
  endforeach()
  file(CONFIGURE OUTPUT ${source} @ONLY CONTENT [=[
#include "server/service/embedded_files.h"

asm(".pushsection .rodata\n"
@symbols@    ".popsection\n");

extern "C" {
@declarations@}

namespace server::service {

std::vector<EmbeddedFile> @function@() {
  return {
@entries@  };
}

}  // namespace server::service
]=])
  set_source_files_properties(${source} PROPERTIES OBJECT_DEPENDS "${paths}")
  target_sources(${target} PRIVATE ${source})
endfunction()
