# SPDX-License-Identifier: MIT
# Toolchain: Cortex-M4 with its single-precision unit, bare metal (newlib).
set(OKID_CPU_FLAGS "-mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16")
include(${CMAKE_CURRENT_LIST_DIR}/cortex-m.cmake)
