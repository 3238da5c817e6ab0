# cmake -DSOURCES=<.glsl files> -DHEADER=<.h> -P glsl_text.cmake: the files, joined, as one C++ string. Their includes of each
# other go: GLSL without an extension has none.
set(text)
foreach(source ${SOURCES})
  file(READ ${source} part)
  string(REGEX REPLACE "#include [^\n]*\n" "" part "${part}")
  string(APPEND text "${part}")
endforeach()
file(WRITE ${HEADER} "#pragma once

namespace tessera::atlas::addressing {

// The .glsl files of atlas/addressing, to follow a shader's #version and precision.
constexpr const char* kGlslText = R\"glsl(
${text})glsl\";

}  // namespace tessera::atlas::addressing
")
