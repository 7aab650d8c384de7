# SPDX-License-Identifier: MIT
# The Unity test framework: an installed package, else upstream at a pinned tag, else the copy inside Debian's cjson
# source package. Never vendored. Gives the target `unity`.
find_package(unity QUIET)
if(unity_FOUND)
  add_library(unity INTERFACE)
  target_link_libraries(unity INTERFACE unity::framework)
else()
  set(OKID_UNITY_TAG v2.6.1)
  if(NOT DEFINED CACHE{OKID_UNITY_SOURCES})
    execute_process(COMMAND ${PROJECT_SOURCE_DIR}/tools/get_unity.sh ${OKID_UNITY_TAG} ${PROJECT_BINARY_DIR}/unity
                    OUTPUT_VARIABLE OKID_UNITY_FOUND OUTPUT_STRIP_TRAILING_WHITESPACE
                    RESULT_VARIABLE OKID_UNITY_STATUS)
    if(NOT OKID_UNITY_STATUS EQUAL 0)
      message(FATAL_ERROR "Unity could not be obtained (see above); set -DOKID_UNITY_SOURCES=DIR with unity.c, or "
                          "build without tests: -DOKID_BUILD_TESTS=OFF")
    endif()
    set(OKID_UNITY_SOURCES ${OKID_UNITY_FOUND} CACHE PATH "folder with unity.c and unity.h")
  endif()
  add_library(unity STATIC ${OKID_UNITY_SOURCES}/unity.c)
  target_include_directories(unity SYSTEM PUBLIC ${OKID_UNITY_SOURCES})
  if(NOT EXISTS ${OKID_UNITY_SOURCES}/../examples/unity_config.h) # Debian's copy brings these settings with it
    target_compile_definitions(unity PUBLIC UNITY_INCLUDE_DOUBLE UNITY_SUPPORT_64)
  endif()
endif()
