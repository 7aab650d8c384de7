// SPDX-License-Identifier: MIT
// PURPOSE  single-producer single-consumer ring of frames
// METHOD   two free-running counters; the writer publishes with release after the copy, the reader with release after its own
#include <drv/ring.h>

#include <stdatomic.h>
#include <string.h>

struct drv_ring_t {
    size_t mask;
    drv_frame_t* slots;
    int overran;                     ///< writer only: the next frame is the first after a loss
    _Alignas(64) atomic_size_t head; ///< frames written
    _Alignas(64) atomic_size_t tail; ///< frames read
    _Alignas(64) atomic_uint_fast64_t overrun;
};

size_t drv_ring_memsize(size_t capacity) {
    if (capacity < 2 || capacity > ((size_t)1 << 24) || (capacity & (capacity - 1)) != 0) return 0;
    return sizeof(drv_ring_t) + 64 + capacity * sizeof(drv_frame_t);
}

drv_ring_t* drv_ring_create(size_t capacity, void* block, size_t bytes) {
    size_t need = drv_ring_memsize(capacity);
    if (need == 0 || block == NULL || bytes < need) return NULL;
    uintptr_t start = ((uintptr_t)block + 63) & ~(uintptr_t)63;
    drv_ring_t* self = (drv_ring_t*)start;
    self->mask = capacity - 1;
    self->slots = (drv_frame_t*)(self + 1);
    self->overran = 0;
    atomic_init(&self->head, 0);
    atomic_init(&self->tail, 0);
    atomic_init(&self->overrun, 0);
    return self;
}

size_t drv_ring_push(drv_ring_t* self, const drv_frame_t* frames, size_t count) {
    size_t head = atomic_load_explicit(&self->head, memory_order_relaxed);
    size_t tail = atomic_load_explicit(&self->tail, memory_order_acquire);
    size_t room = self->mask + 1 - (head - tail);
    size_t taken = count < room ? count : room;
    for (size_t i = 0; i < taken; ++i) {
        drv_frame_t* slot = &self->slots[(head + i) & self->mask];
        *slot = frames[i];
        if (self->overran) slot->loss |= DRV_LOSS_DRIVER;
        self->overran = 0;
    }
    atomic_store_explicit(&self->head, head + taken, memory_order_release);
    if (taken < count) {
        self->overran = 1;
        atomic_fetch_add_explicit(&self->overrun, count - taken, memory_order_relaxed);
    }
    return taken;
}

size_t drv_ring_pop(drv_ring_t* self, drv_frame_t* frames, size_t capacity) {
    size_t tail = atomic_load_explicit(&self->tail, memory_order_relaxed);
    size_t head = atomic_load_explicit(&self->head, memory_order_acquire);
    size_t ready = head - tail;
    size_t taken = capacity < ready ? capacity : ready;
    for (size_t i = 0; i < taken; ++i) frames[i] = self->slots[(tail + i) & self->mask];
    atomic_store_explicit(&self->tail, tail + taken, memory_order_release);
    return taken;
}

uint64_t drv_ring_overrun(const drv_ring_t* self) {
    return atomic_load_explicit(&((drv_ring_t*)self)->overrun, memory_order_relaxed);
}

size_t drv_ring_used(const drv_ring_t* self) {
    drv_ring_t* ring = (drv_ring_t*)self;
    size_t tail = atomic_load_explicit(&ring->tail, memory_order_acquire);
    return atomic_load_explicit(&ring->head, memory_order_acquire) - tail;
}
