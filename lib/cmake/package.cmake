# SPDX-License-Identifier: MIT
# What another project finds: find_package(okid) gives okid::okid (shared) and okid::okid_static, pkg-config the same.
include(CMakePackageConfigHelpers)
set(OKID_CMAKE_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/okid)
install(TARGETS ${OKID_LIBRARIES} EXPORT okid LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY include/okid DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h")
install(EXPORT okid NAMESPACE okid:: FILE okid-targets.cmake DESTINATION ${OKID_CMAKE_DIR})
configure_package_config_file(cmake/okid-config.cmake.in okid-config.cmake INSTALL_DESTINATION ${OKID_CMAKE_DIR})
write_basic_package_version_file(okid-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/okid-config.cmake ${CMAKE_CURRENT_BINARY_DIR}/okid-config-version.cmake
        DESTINATION ${OKID_CMAKE_DIR})

set(OKID_PC_DEFINES "")
if(OKID_REAL STREQUAL float)
  string(APPEND OKID_PC_DEFINES " -DOKID_REAL=float")
endif()
if(OKID_INTEGER_KERNEL)
  string(APPEND OKID_PC_DEFINES " -DOKID_INTEGER_KERNEL")
endif()
set(OKID_PC_PRIVATE "-lstdc++ -lm") # of the archive: what its C++ and its mathematics stand on
if(OKID_LINALG STREQUAL lapacke)
  string(PREPEND OKID_PC_PRIVATE "-llapacke -lopenblas ")
endif()
# A relative libdir finds its prefix from where okid.pc lies, also after cmake --install --prefix or a move of the tree.
set(OKID_PC_PREFIX ${CMAKE_INSTALL_PREFIX})
if(NOT IS_ABSOLUTE ${CMAKE_INSTALL_LIBDIR})
  file(RELATIVE_PATH OKID_PC_UP /prefix/${CMAKE_INSTALL_LIBDIR}/pkgconfig /prefix)
  string(REGEX REPLACE "/$" "" OKID_PC_UP "${OKID_PC_UP}")
  set(OKID_PC_PREFIX "\${pcfiledir}/${OKID_PC_UP}")
endif()
configure_file(cmake/okid.pc.in okid.pc @ONLY)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/okid.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)

# The same names where the library is part of another project.
add_library(okid::okid ALIAS okid)
add_library(okid::okid_static ALIAS okid_static)
