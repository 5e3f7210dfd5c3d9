# What `cpack` makes: treelight_VERSION_ARCHITECTURE.deb with the programs and their service, libtreelight-dev with what
# cmake/install.cmake installs for other projects. `cmake --workflow --preset package` builds both for Debian 12.
set(TREELIGHT_MAINTAINER "Treelight maintainers <maintainers@treelight.example>" CACHE STRING
  "Who signs for the Debian packages")
set(debian ${PROJECT_SOURCE_DIR}/cmake/debian)

# Files of Debian packages alone: `cmake --install` leaves them out, and so may their paths be absolute.
function(install_for_debian component folder file)
  cmake_parse_arguments(PARSE_ARGV 3 to "" "NAME" "")
  if(NOT to_NAME)
    get_filename_component(to_NAME ${file} NAME)
  endif()
  install(FILES ${file} DESTINATION ${folder} RENAME ${to_NAME} COMPONENT ${component} EXCLUDE_FROM_ALL)
endfunction()
install_for_debian(service /lib/systemd/system ${debian}/treelightd.service)
install_for_debian(service /etc/default ${debian}/treelightd.default NAME treelightd)
set(documents ${PROJECT_BINARY_DIR}/debian)
file(MAKE_DIRECTORY ${documents})
execute_process(COMMAND gzip -9nc ${debian}/changelog OUTPUT_FILE ${documents}/changelog.gz COMMAND_ERROR_IS_FATAL ANY)
foreach(package treelight libtreelight-dev)
  install_for_debian(${package}_documents /usr/share/doc/${package} ${debian}/copyright)
  install_for_debian(${package}_documents /usr/share/doc/${package} ${documents}/changelog.gz)
endforeach()
install(DIRECTORY examples DESTINATION /usr/share/doc/libtreelight-dev COMPONENT libtreelight-dev_documents
  EXCLUDE_FROM_ALL USE_SOURCE_PERMISSIONS)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME treelight)
set(CPACK_PACKAGE_VENDOR "Treelight")
set(CPACK_PACKAGE_CONTACT ${TREELIGHT_MAINTAINER})
set(CPACK_STRIP_FILES ON)
set(CPACK_SET_DESTDIR ON)  # some paths are absolute
set(CPACK_INSTALL_PREFIX /usr)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING ONE_PER_GROUP)
set(CPACK_COMPONENTS_ALL programs service treelight_documents development libtreelight-dev_documents)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

set(CPACK_DEBIAN_TREELIGHT_PACKAGE_NAME treelight)
set(CPACK_DEBIAN_TREELIGHT_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_TREELIGHT_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_TREELIGHT_PACKAGE_DEPENDS "init-system-helpers (>= 1.52), passwd")
# A GPU wants its driver; the CPU is used without one, so that nobody is given PoCL and its compiler unasked.
set(CPACK_DEBIAN_TREELIGHT_PACKAGE_SUGGESTS "opencl-icd")
set(CPACK_DEBIAN_TREELIGHT_PACKAGE_CONTROL_EXTRA
  "${debian}/conffiles;${debian}/postinst;${debian}/prerm;${debian}/postrm")
set(CPACK_COMPONENT_TREELIGHT_DESCRIPTION "photon map service with k-d trees on GPUs and CPUs
treelightd takes photons over gRPC, builds k-d trees over them on a GPU, or on
the CPU, and answers batches of gather queries: the k nearest
photons within a radius, counts, and radiance estimates.

treelight is its command line client: it uploads and gathers photons, traces
them through scenes, and renders pictures with photon maps.")

set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libtreelight-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
  "libabsl-dev (>= 20220623), libfmt-dev (>= 9), libgrpc++-dev (>= 1.51), libprotobuf-dev (>= 3.21.12), \
libprotobuf-dev (<< 3.22), libtbb-dev (>= 2021), libxxhash-dev, ocl-icd-opencl-dev, pkg-config")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SUGGESTS "treelight (= ${PROJECT_VERSION}), cmake, protobuf-compiler-grpc")
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION "photon map client and k-d trees on GPUs and CPUs, development files
Headers, static libraries and the CMake package of Treelight: a client of the
photon map service treelightd, the trees that the service is made of, for use
in one's own process, and photon_map.proto, from which other languages
generate their clients.")

include(CPack)
cpack_add_component_group(treelight)
cpack_add_component_group(development)
cpack_add_component(programs GROUP treelight)
cpack_add_component(service GROUP treelight)
cpack_add_component(treelight_documents GROUP treelight)
cpack_add_component(development GROUP development)
cpack_add_component(libtreelight-dev_documents GROUP development)
