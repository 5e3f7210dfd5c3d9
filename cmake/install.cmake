# What `cmake --install` installs: the programs, and for other CMake projects the client library, the core, their headers
# and the package that find_package(treelight) finds.
#
# Headers keep the paths that they are included by: client/ and core/ under include/treelight, which is an include
# directory of its own, and the generated ones under include/treelight/v1.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

install(TARGETS treelightd treelight RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT programs)
install(DIRECTORY scenes/ DESTINATION ${CMAKE_INSTALL_DATADIR}/treelight/scenes COMPONENT programs)
find_program(HELP2MAN help2man)  # without it there are no manual pages
if(HELP2MAN)
  install(CODE "
    set(HELP2MAN ${HELP2MAN})
    set(TREELIGHTD $<TARGET_FILE:treelightd>)
    set(TREELIGHT $<TARGET_FILE:treelight>)
    set(FOLDER \$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_MANDIR}/man1)" COMPONENT programs)
  install(SCRIPT cmake/man_pages.cmake COMPONENT programs)
endif()

# treelight::client, treelight::core and treelight::proto, in this build as for those who install it.
foreach(library client core proto)
  add_library(treelight::${library} ALIAS treelight_${library})
  # The plugin of a renderer is a shared library, and links these static ones.
  set_target_properties(treelight_${library} PROPERTIES EXPORT_NAME ${library} POSITION_INDEPENDENT_CODE ON)
endforeach()
target_include_directories(treelight_core INTERFACE $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/treelight>)
target_include_directories(treelight_proto INTERFACE $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
install(TARGETS treelight_client treelight_core treelight_proto EXPORT treelight-targets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)

set(headers ${CMAKE_INSTALL_INCLUDEDIR}/treelight)
set(proto_folder ${CMAKE_INSTALL_DATADIR}/treelight/proto)
install(FILES client/photon_map_client.h DESTINATION ${headers}/client COMPONENT development)
install(FILES core/builder.h core/gatherer.h DESTINATION ${headers}/core COMPONENT development)
install(FILES core/kernels/types.h DESTINATION ${headers}/core/kernels COMPONENT development)
install(DIRECTORY core/model/ DESTINATION ${headers}/core/model COMPONENT development FILES_MATCHING PATTERN *.h)
install(DIRECTORY ${PROJECT_BINARY_DIR}/proto/treelight/v1/ DESTINATION ${headers}/v1 COMPONENT development
  FILES_MATCHING PATTERN *.pb.h)
install(DIRECTORY proto/treelight DESTINATION ${proto_folder} COMPONENT development)

set(package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/treelight)
install(EXPORT treelight-targets NAMESPACE treelight:: DESTINATION ${package_folder} COMPONENT development)
configure_package_config_file(cmake/treelight-config.cmake.in ${PROJECT_BINARY_DIR}/treelight-config.cmake
  INSTALL_DESTINATION ${package_folder} PATH_VARS proto_folder)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/treelight-config-version.cmake
  COMPATIBILITY SameMinorVersion)  # as long as the version is 0.x
install(FILES ${PROJECT_BINARY_DIR}/treelight-config.cmake ${PROJECT_BINARY_DIR}/treelight-config-version.cmake
  DESTINATION ${package_folder} COMPONENT development)
