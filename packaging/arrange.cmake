# SPDX-License-Identifier: MIT
# Runs in CPack between install and packing: puts what the components installed where the packages want it.
set(staged ${CPACK_TEMPORARY_DIRECTORY})
foreach(moved libokid:runtime libokid_host:host)
  string(REPLACE ":" ";" moved ${moved})
  list(GET moved 0 library)
  list(GET moved 1 package)
  file(GLOB shared ${staged}/Unspecified/usr/lib/*/${library}.so.*)
  if(NOT shared)
    message(FATAL_ERROR "packaging/arrange.cmake: no ${library}.so.* under ${staged}/Unspecified/usr/lib")
  endif()
  foreach(file ${shared})
    string(REPLACE "${staged}/Unspecified/" "${staged}/${package}/" target ${file})
    get_filename_component(folder ${target} DIRECTORY)
    file(MAKE_DIRECTORY ${folder})
    file(RENAME ${file} ${target})
  endforeach()
endforeach()

# A source install leaves this one to be copied by hand, the package has it at work.
file(MAKE_DIRECTORY ${staged}/program/etc/logrotate.d)
file(RENAME ${staged}/program/usr/share/okid/okid.logrotate ${staged}/program/etc/logrotate.d/okid)
file(REMOVE_RECURSE ${staged}/program/usr/share/okid)
