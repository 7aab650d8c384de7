// SPDX-License-Identifier: MIT
/// @file bus_load.h
/// How long a frame holds the wire: every bit counted, stuff bits and the gap between frames included.
#ifndef DRV_BUS_LOAD_H
#define DRV_BUS_LOAD_H

#include <drv/frame.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Bits of a frame at the two rates of the bus; a frame without bit-rate switch has slow bits only.
typedef struct drv_wire_bits_t {
    uint32_t slow; ///< at the nominal rate
    uint32_t fast; ///< at the data rate (FD with BRS): from behind the BRS bit to the end of the CRC
} drv_wire_bits_t;

/// Exact for classic frames (CRC-15 computed) and for ISO FD frames (the fixed stuff bits of their CRC field make its
/// length known). Bit times that the rate changes within (BRS, CRC delimiter) count as slow; error messages have 0 bits.
/// Cost: one pass over the bits, 0.1 to 1 microsecond.
drv_wire_bits_t drv_wire_bits(const drv_frame_t* frame);

/// Time on the wire in seconds. @param bitrate  bit/s, > 0  @param dbitrate  bit/s, 0 = as bitrate
double drv_wire_seconds(const drv_frame_t* frame, double bitrate, double dbitrate);

#ifdef __cplusplus
}
#endif
#endif
