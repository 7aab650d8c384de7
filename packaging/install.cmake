# SPDX-License-Identifier: MIT
# The version in the name of the shared libraries, and what stands beside the program. Debian packages: packaging/debian.
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
if(TARGET okid_program)
  include(GNUInstallDirs)
  include(packaging/documents.cmake)
endif()
