# SPDX-License-Identifier: MIT
# What the Cortex-M toolchains share. No heap, no exceptions, no start-up code but our own; what is not called is not there.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_CXX_COMPILER arm-none-eabi-g++)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(CMAKE_PREFIX_PATH /usr) # where Eigen's headers are
set(OKID_BARE_FLAGS "${OKID_CPU_FLAGS} -ffunction-sections -fdata-sections")
set(CMAKE_C_FLAGS_INIT "${OKID_BARE_FLAGS}")
set(CMAKE_CXX_FLAGS_INIT "${OKID_BARE_FLAGS} -fno-exceptions -fno-rtti -fno-threadsafe-statics -fno-use-cxa-atexit")
