// SPDX-License-Identifier: MIT
/// @file ring.h
/// A ring of frames between two threads: one writes, one reads, no locks, no heap. The writer never waits: when the
/// ring is full the oldest frames make room and are counted, and the oldest that survives carries DRV_LOSS_DRIVER.
#ifndef DRV_RING_H
#define DRV_RING_H

#include <drv/frame.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Private; lives in the caller's block.
typedef struct drv_ring_t drv_ring_t;

/// Bytes drv_ring_create() needs; 0 when capacity is not a power of two in 2..2^24.
size_t drv_ring_memsize(size_t capacity);
/// Lay a ring out in the caller's block. @return NULL when the block is too small or the capacity is invalid
drv_ring_t* drv_ring_create(size_t capacity, void* block, size_t bytes);

/// Writer: append frames, all of them. @return how many old ones made room
size_t drv_ring_push(drv_ring_t* self, const drv_frame_t* frames, size_t count);
/// Reader: take up to `capacity` frames in order. What was lost between them stands before the first one only.
/// @return frames taken
size_t drv_ring_pop(drv_ring_t* self, drv_frame_t* frames, size_t capacity);
/// Reader: frames lost before those taken so far.
uint64_t drv_ring_missed(const drv_ring_t* self);

/// Frames lost so far. Any thread.
uint64_t drv_ring_overrun(const drv_ring_t* self);
/// Frames waiting. Any thread.
size_t drv_ring_used(const drv_ring_t* self);

#ifdef __cplusplus
}
#endif
#endif
