# SPDX-License-Identifier: MIT
# What a node has of the drivers: packets, their sums, frames. No operating system, no heap.
set(DRV_NODE_SOURCES
    src/cobs.c
    src/crc.c
    src/stream_encode.c
    src/codec.c)
