# SPDX-License-Identifier: MIT
# Makes preset_files.cpp in the build folder of who includes this.
# The presets are part of the program: it finds them wherever it is installed.
file(GLOB OKID_PRESETS CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/drivers/presets/*.toml)
set(text "#include \"config/presets.hpp\"\nnamespace okid_host {\nextern const std::vector<std::pair<std::string_view, std::string_view>> preset_files = {\n")
foreach(file ${OKID_PRESETS})
  get_filename_component(name ${file} NAME_WE)
  file(READ ${file} preset)
  string(APPEND text "{\"${name}\", R\"preset(${preset})preset\"},\n")
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${file})
endforeach()
file(CONFIGURE OUTPUT preset_files.cpp CONTENT "${text}};\n} // namespace okid_host\n" @ONLY)
