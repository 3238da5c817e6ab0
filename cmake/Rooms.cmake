# One folder = one library `tessera_<name>` = one namespace `tessera::<name>`; a folder in a room that others may use without
# the rest of it is a room of its own. This table is the only place that
# says which room may use which (docs/architecture.md); tessera_check_rooms() fails the configure step when a target
# links outside its list, and tests/architecture checks the #include lines.
set(TESSERA_ROOMS base proto gpu scene pvs atlas/addressing atlas shading codec geometry-compression transport client-sdk server bench)
set(TESSERA_MAY_USE_base "")
set(TESSERA_MAY_USE_proto base)
set(TESSERA_MAY_USE_gpu base)
set(TESSERA_MAY_USE_scene base gpu)
set(TESSERA_MAY_USE_pvs base gpu scene)
set(TESSERA_MAY_USE_atlas/addressing "")
set(TESSERA_MAY_USE_atlas base gpu scene atlas/addressing)
set(TESSERA_MAY_USE_shading base gpu scene atlas atlas/addressing)
set(TESSERA_MAY_USE_codec base gpu)
set(TESSERA_MAY_USE_geometry-compression "")
set(TESSERA_MAY_USE_transport base)
set(TESSERA_MAY_USE_client-sdk base proto atlas/addressing codec geometry-compression transport)
set(TESSERA_MAY_USE_server base gpu scene pvs atlas atlas/addressing shading codec geometry-compression transport proto)
set(TESSERA_MAY_USE_bench ${TESSERA_ROOMS})

function(tessera_room_target room out)
  string(REGEX REPLACE "[-/]" "_" name ${room})
  set(${out} tessera_${name} PARENT_SCOPE)
endfunction()

# tessera_room(<room> SOURCES ... [USES <rooms>...] [LINKS <outside libraries>...])
# The room's target; headers are included as "<room>/<file>.h".
function(tessera_room room)
  cmake_parse_arguments(ARG "" "" "SOURCES;USES;LINKS" ${ARGN})
  tessera_room_target(${room} target)
  add_library(${target} STATIC ${ARG_SOURCES})
  target_include_directories(${target} PUBLIC ${CMAKE_SOURCE_DIR})
  foreach(used ${ARG_USES})
    if(NOT used IN_LIST TESSERA_MAY_USE_${room})
      message(FATAL_ERROR "room `${room}` may not use `${used}` (see cmake/Rooms.cmake)")
    endif()
    tessera_room_target(${used} used_target)
    target_link_libraries(${target} PUBLIC ${used_target})
  endforeach()
  target_link_libraries(${target} PUBLIC ${ARG_LINKS})
endfunction()

# tessera_shaders(<room> <file.comp|vert|frag>...): compiles each file to SPIR-V and embeds it. In C++:
#   #include "<room>/shaders/<file>.spv.h"   →   constexpr-like `const uint32_t <file with _ for .>[]`
# GLSL files include each other as "<room>/shaders/<file>.glsl".
function(tessera_shaders room)
  tessera_room_target(${room} target)
  set(generated ${CMAKE_BINARY_DIR}/generated)
  foreach(file ${ARGN})
    string(REPLACE "." "_" symbol ${file})
    set(source ${CMAKE_SOURCE_DIR}/${room}/shaders/${file})
    set(header ${generated}/${room}/shaders/${file}.spv.h)
    add_custom_command(
      OUTPUT ${header}
      COMMAND ${CMAKE_COMMAND} -E make_directory ${generated}/${room}/shaders
      COMMAND ${GLSLANG_VALIDATOR} --quiet --target-env vulkan1.3 -I${CMAKE_SOURCE_DIR} --vn ${symbol}
              --depfile ${header}.d -o ${header} ${source}
      DEPENDS ${source}
      DEPFILE ${header}.d
      COMMENT "Shader ${room}/shaders/${file}"
      VERBATIM)
    target_sources(${target} PRIVATE ${header})
  endforeach()
  target_include_directories(${target} PRIVATE ${generated})
endfunction()

# tessera_program(<name> SOURCES ... ROOMS ... [LINKS ...]): an executable in build/<preset>/bin.
function(tessera_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;ROOMS;LINKS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  foreach(used ${ARG_ROOMS})
    tessera_room_target(${used} used_target)
    target_link_libraries(${name} PRIVATE ${used_target})
  endforeach()
  target_link_libraries(${name} PRIVATE ${ARG_LINKS})
endfunction()

function(tessera_check_rooms)
  foreach(room ${TESSERA_ROOMS})
    tessera_room_target(${room} target)
    get_target_property(links ${target} LINK_LIBRARIES)
    foreach(other ${TESSERA_ROOMS})
      tessera_room_target(${other} other_target)
      if(other_target IN_LIST links AND NOT other IN_LIST TESSERA_MAY_USE_${room})
        message(FATAL_ERROR "${target} links ${other_target}, which cmake/Rooms.cmake does not allow")
      endif()
    endforeach()
  endforeach()
endfunction()
