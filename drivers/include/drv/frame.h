// SPDX-License-Identifier: MIT
/// @file frame.h
/// One CAN frame as every source delivers it.
#ifndef DRV_FRAME_H
#define DRV_FRAME_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Bits of drv_frame_t::flags.
enum {
    DRV_FRAME_EXTENDED = 1 << 0, ///< 29-bit identifier
    DRV_FRAME_REMOTE = 1 << 1,   ///< remote request, no data
    DRV_FRAME_ERROR = 1 << 2,    ///< error message of the controller; id holds its class bits. Never data
    DRV_FRAME_FD = 1 << 3,       ///< CAN FD
    DRV_FRAME_BRS = 1 << 4,      ///< FD, bit rate switched
    DRV_FRAME_ESI = 1 << 5       ///< FD, sender is error passive
};

/// Bits of drv_frame_t::loss: what is known to have gone missing on the bus just before this frame.
enum {
    DRV_LOSS_OVERFLOW = 1 << 0, ///< the socket's receive buffer was full
    DRV_LOSS_DRIVER = 1 << 1,   ///< the controller's queue or our own ring was full
    DRV_LOSS_LINK = 1 << 2,     ///< the interface was down or away
    DRV_LOSS_CRC = 1 << 3       ///< serial: bytes arrived that made no valid packet
};

/// A frame with its times.
typedef struct drv_frame_t {
    int64_t time_ns;    ///< host time of arrival (host_clock.h), or the stamp of the log
    int64_t hw_time_ns; ///< the controller's own stamp, 0 = none
    uint32_t id;        ///< 11 or 29 bits, no flags inside
    uint8_t flags;      ///< DRV_FRAME_… bits
    uint8_t loss;       ///< DRV_LOSS_… bits
    uint8_t bus;        ///< which interface of the source, 0 first
    uint8_t len;        ///< bytes in data, 0..64; of a remote frame the length asked for
    uint8_t data[64];   ///< the first `len` count
} drv_frame_t;

#ifdef __cplusplus
}
#endif
#endif
