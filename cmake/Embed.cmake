# Files inside a program, so that it needs none beside it.
#
#   splatdrag_embed(server_service page_files ${CMAKE_SOURCE_DIR}/web index.html main.js ...)
#
# adds to the target a source that defines server::service::page_files() (declared in server/service/embedded_files.h): the files below
# the folder, by the names given, with their bytes. The assembler copies the bytes, so that even large files compile at
# once; a file that changes is copied anew.
function(splatdrag_embed target function folder)
  set(source ${CMAKE_CURRENT_BINARY_DIR}/embedded_${function}.cc)
  set(symbols "")
  set(declarations "")
  set(entries "")
  set(paths "")
  set(number 0)
  foreach(name ${ARGN})
    set(symbol splatdrag_embedded_${function}_${number})
    string(APPEND symbols "    \"${symbol}:\\n.incbin \\\"${folder}/${name}\\\"\\n${symbol}_end:\\n.byte 0\\n\"\n")
    string(APPEND declarations "extern const char ${symbol}[], ${symbol}_end[];\n")
    string(APPEND entries "      {\"${name}\", {${symbol}, std::size_t(${symbol}_end - ${symbol})}},\n")
    list(APPEND paths ${folder}/${name})
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
