# SPDX-License-Identifier: MIT
# Debian packages (`make package`), and the version in the name of the shared library that every install needs.
#
# Four packages, as Debian Policy 8 asks of shared libraries: the names of libokid0.2 and libokid-host0.2 change with the ABI,
# so that programs built against an older one can keep it, and a machine in the field gets okid without compilers and headers.
# The program has both inside (it is linked with the archives), so okid does not depend on them.
# Libraries and headers install without components: all that is the component Unspecified, here that of the headers, and
# packaging/arrange.cmake moves the shared objects to the packages that are named for them.
if(SKBUILD OR NOT PROJECT_IS_TOP_LEVEL OR NOT OKID_SHARED) # a wheel, a part of another project, a microcontroller
  return()
endif()
set(OKID_ABI ${PROJECT_VERSION_MAJOR})
if(PROJECT_VERSION_MAJOR EQUAL 0) # until 1.0 a minor version may break it, as find_package(okid) takes it too
  set(OKID_ABI ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
endif()
foreach(library okid okid_host_shared)
  if(TARGET ${library})
    set_target_properties(${library} PROPERTIES VERSION ${PROJECT_VERSION} SOVERSION ${OKID_ABI})
  endif()
endforeach()
if(NOT TARGET okid_program)
  return()
endif()
include(GNUInstallDirs)
include(packaging/documents.cmake)
if(NOT OKID_PACKAGE)
  return()
endif()

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME okid)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "") # each package has its own, as the first line of its description
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(contact "the okid authors <okid@example.org>") # who makes packages for others sets these two, as for dpkg-buildpackage
if(DEFINED ENV{DEBEMAIL} AND DEFINED ENV{DEBFULLNAME})
  set(contact "$ENV{DEBFULLNAME} <$ENV{DEBEMAIL}>")
endif()
set(CPACK_PACKAGE_CONTACT ${contact})
set(CPACK_SET_DESTDIR ON) # paths inside the files are those of the installed system
set(CPACK_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR}/packages)
set(CPACK_COMPONENTS_ALL program runtime host Unspecified)
set(CPACK_PRE_BUILD_SCRIPTS ${PROJECT_SOURCE_DIR}/packaging/arrange.cmake)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_COMPRESSION_TYPE xz)

set(scripts ${PROJECT_SOURCE_DIR}/packaging/debian)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME okid)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_DEPENDS "systemd-standalone-sysusers | systemd-sysusers") # makes user and group
set(CPACK_DEBIAN_PROGRAM_PACKAGE_RECOMMENDS can-utils)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SUGGESTS "bash-completion, logrotate")
set(CPACK_DEBIAN_PROGRAM_DESCRIPTION "modes of a structure from its sensor frames, live
okid decodes frames of sensors (CAN, serial lines), aligns them on one sample
grid, and identifies natural frequencies, damping ratios and mode shapes with
their standard deviations while the structure shakes; then mass, stiffness and
damping matrices. It records, replays and converts what came over the bus, and
runs as a service.")
set(CPACK_DEBIAN_PROGRAM_PACKAGE_CONTROL_EXTRA ${scripts}/postinst ${scripts}/prerm ${scripts}/postrm ${scripts}/conffiles)

set(CPACK_DEBIAN_RUNTIME_PACKAGE_NAME libokid${OKID_ABI})
set(CPACK_DEBIAN_RUNTIME_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_RUNTIME_DESCRIPTION "identification of structures from vibration records, shared library
The kernels of okid for programs in C and C++: recursive accumulation of
records in fixed memory, system and modes by OKID, ERA and subspace methods,
mass, stiffness and damping matrices, standard deviations.")
set(CPACK_DEBIAN_RUNTIME_PACKAGE_CONTROL_EXTRA ${scripts}/triggers ${PROJECT_BINARY_DIR}/documents/shlibs)

set(CPACK_DEBIAN_HOST_PACKAGE_NAME libokid-host${OKID_ABI})
set(CPACK_DEBIAN_HOST_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_HOST_PACKAGE_DEPENDS "libokid${OKID_ABI} (= ${PROJECT_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE})")
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${PROJECT_BINARY_DIR}) # where it finds libokid
set(CPACK_DEBIAN_HOST_DESCRIPTION "modes of a structure from its sensor frames, shared library
What the program okid does, for other languages: measured records to a result,
samples and frames as they arrive to results, configurations and signal
descriptions read.")
set(CPACK_DEBIAN_HOST_PACKAGE_CONTROL_EXTRA ${scripts}/triggers ${PROJECT_BINARY_DIR}/documents/host/shlibs)

set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_NAME libokid-dev)
set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_SHLIBDEPS OFF)
set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_DEPENDS "libokid-host${OKID_ABI} (= ${PROJECT_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE}), ${CPACK_DEBIAN_HOST_PACKAGE_DEPENDS}")
set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_RECOMMENDS "liblapacke-dev, libopenblas-dev, libgpiod-dev") # only the archives ask for them
set(CPACK_DEBIAN_UNSPECIFIED_DESCRIPTION "identification of structures from vibration records, headers
Headers of libokid, libokid-host and the drivers for CAN and serial lines;
static libraries, CMake package and pkg-config file.")

# Of every package: who may copy it, what changed upstream and in the package.
set(made ${PROJECT_BINARY_DIR}/documents)
string(TIMESTAMP date "%a, %d %b %Y %H:%M:%S +0000" UTC) # SOURCE_DATE_EPOCH when that is set
file(CONFIGURE OUTPUT ${made}/changelog.Debian CONTENT "okid (${PROJECT_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE}) unstable; urgency=medium

  * Packages made by CPack out of the upstream tree; see changelog.gz.

 -- ${CPACK_PACKAGE_CONTACT}  ${date}\n")
file(CONFIGURE OUTPUT ${made}/shlibs CONTENT "libokid ${OKID_ABI} libokid${OKID_ABI} (>= ${PROJECT_VERSION})\n")
configure_file(${PROJECT_SOURCE_DIR}/CHANGELOG.md ${made}/changelog COPYONLY)
execute_process(COMMAND gzip -9nkf changelog changelog.Debian WORKING_DIRECTORY ${made} COMMAND_ERROR_IS_FATAL ANY)
file(CONFIGURE OUTPUT ${made}/host/shlibs CONTENT "libokid_host ${OKID_ABI} libokid-host${OKID_ABI} (>= ${PROJECT_VERSION})\n")
foreach(part program:okid runtime:libokid${OKID_ABI} host:libokid-host${OKID_ABI} Unspecified:libokid-dev)
  string(REPLACE ":" ";" part ${part})
  list(GET part 0 component)
  list(GET part 1 package)
  install(FILES ${PROJECT_SOURCE_DIR}/packaging/debian/copyright ${made}/changelog.gz ${made}/changelog.Debian.gz
          DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/doc/${package} COMPONENT ${component} EXCLUDE_FROM_ALL)
  install(FILES ${scripts}/overrides/${component} DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/lintian/overrides
          RENAME ${package} COMPONENT ${component} EXCLUDE_FROM_ALL)
endforeach()
include(CPack)
