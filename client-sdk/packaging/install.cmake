# cmake --install: component `client-runtime` has the shared library, `client-development` what an app is built with.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

target_include_directories(tessera_client_library INTERFACE $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
install(TARGETS tessera_client_library EXPORT TesseraClient
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}
  COMPONENT client-runtime NAMELINK_COMPONENT client-development)
install(DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR}/include/tessera DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
  COMPONENT client-development)

# find_package(TesseraClient): target Tessera::client.
set(package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/TesseraClient)
install(EXPORT TesseraClient NAMESPACE Tessera:: FILE TesseraClientConfig.cmake DESTINATION ${package_folder}
  COMPONENT client-development)
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/TesseraClientConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/TesseraClientConfigVersion.cmake DESTINATION ${package_folder}
  COMPONENT client-development)

# pkg-config: tessera-client. Relative to where it lies, so that an installed tree can be moved.
string(REGEX REPLACE "[^/]+" ".." to_prefix ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
configure_file(${CMAKE_CURRENT_SOURCE_DIR}/packaging/tessera-client.pc.in
  ${CMAKE_CURRENT_BINARY_DIR}/tessera-client.pc @ONLY)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/tessera-client.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig
  COMPONENT client-development)
