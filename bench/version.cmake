# Writes the header that says which sources a result comes from: run at build time by bench/CMakeLists.txt.
#   commit:   git's name for the checkout, "-dirty" with changes; "unknown" without git
#   renderer: fingerprint of the sources that decide the truth's pixels, part of the truth cache's key
set(TESSERA_COMMIT unknown)
find_program(GIT_PROGRAM git)
if(GIT_PROGRAM)
  execute_process(COMMAND ${GIT_PROGRAM} -C ${SOURCE_DIR} describe --always --dirty --abbrev=12 --exclude=*
                  OUTPUT_VARIABLE described OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE failed)
  if(NOT failed)
    set(TESSERA_COMMIT ${described})
  endif()
endif()

set(hashes "")
foreach(room base gpu scene shading)
  file(GLOB_RECURSE sources ${SOURCE_DIR}/${room}/*)
  list(SORT sources)
  foreach(source ${sources})
    file(SHA256 ${source} hash)
    string(APPEND hashes ${hash})
  endforeach()
endforeach()
string(SHA256 TESSERA_RENDERER "${hashes}")
string(SUBSTRING ${TESSERA_RENDERER} 0 16 TESSERA_RENDERER)

configure_file(${SOURCE_DIR}/bench/version.h.in ${HEADER})
