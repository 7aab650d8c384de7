# SPDX-License-Identifier: MIT
# What stands beside the program: documents, and with OKID_PACKAGE man pages and completions, made by the program itself.
option(OKID_PACKAGE "man pages and completions too, for an install or a package" OFF)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/docs/ DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/doc/okid COMPONENT program
        FILES_MATCHING PATTERN "*.md" PATTERN "*.png" PATTERN "*.ipynb" PATTERN "*.json" PATTERN "*.xml")
install(FILES ${PROJECT_SOURCE_DIR}/tests/replay/demo_rig.toml DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/doc/okid/examples
        RENAME rig.toml COMPONENT program)
install(FILES ${PROJECT_SOURCE_DIR}/drivers/proto/okid.dbc DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/doc/okid/examples
        COMPONENT program)
if(NOT OKID_PACKAGE)
  return()
endif()
if(CMAKE_CROSSCOMPILING)
  message(STATUS "okid: no man pages and no completions: they are made by the program, which does not run here")
  return()
endif()

set(OKID_COMPLETIONS "")
foreach(shell bash:bash-completion/completions/okid zsh:zsh/vendor-completions/_okid fish:fish/vendor_completions.d/okid.fish)
  string(REGEX MATCH "^[a-z]+" name ${shell})
  string(REGEX REPLACE "^[a-z]+:" "" path ${shell})
  set(script ${PROJECT_BINARY_DIR}/documents/${path})
  get_filename_component(folder ${path} DIRECTORY)
  file(MAKE_DIRECTORY ${PROJECT_BINARY_DIR}/documents/${folder})
  add_custom_command(OUTPUT ${script} COMMAND okid_program completion ${name} > ${script} DEPENDS okid_program VERBATIM)
  list(APPEND OKID_COMPLETIONS ${script})
  install(FILES ${script} DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/${folder} COMPONENT program)
endforeach()
add_custom_target(okid_completions ALL DEPENDS ${OKID_COMPLETIONS})

find_program(OKID_HELP2MAN help2man)
if(NOT OKID_HELP2MAN)
  message(STATUS "okid: no man pages: help2man was not found (Debian: apt-get install help2man)")
  return()
endif()
set(pages ${PROJECT_BINARY_DIR}/documents/man1)
set(maker ${PROJECT_SOURCE_DIR}/packaging/man/make_pages)
file(GLOB parts CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/packaging/man/*.h2m)
add_custom_command(OUTPUT ${pages}/okid.1.gz COMMAND ${maker} $<TARGET_FILE:okid_program> ${pages}
                   DEPENDS okid_program ${maker} ${parts} VERBATIM)
add_custom_target(okid_man ALL DEPENDS ${pages}/okid.1.gz)
install(DIRECTORY ${pages}/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT program FILES_MATCHING PATTERN "*.1.gz")
