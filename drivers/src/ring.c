// SPDX-License-Identifier: MIT
// PURPOSE  ring of frames from one thread to another; a writer that never waits
// METHOD   two free-running counters. A full ring: the writer moves the reader's counter on before it writes over a
//          slot. The reader copies, then claims what it copied by compare-and-swap on that counter: it fails when the
//          writer was there meanwhile, and the copy is made again. Slots are words, stored with release and loaded with
//          acquire: a reader that sees a new word sees the counter that was moved before it
#include <drv/ring.h>

#include <stdatomic.h>
#include <string.h>

enum { WORDS = sizeof(drv_frame_t) / sizeof(uint64_t) };
_Static_assert(sizeof(drv_frame_t) % sizeof(uint64_t) == 0, "a frame is copied word by word");

typedef struct slot_t {
    atomic_uint_fast64_t words[WORDS];
} slot_t;

struct drv_ring_t {
    size_t mask;
    slot_t* slots;
    _Alignas(64) atomic_size_t head; ///< frames written
    _Alignas(64) atomic_size_t tail; ///< frames read or given up
    size_t expected;                 ///< reader only: the next frame when none is lost
    uint64_t missed;                 ///< reader only
    _Alignas(64) atomic_uint_fast64_t overrun;
};

size_t drv_ring_memsize(size_t capacity) {
    if (capacity < 2 || capacity > ((size_t)1 << 24) || (capacity & (capacity - 1)) != 0) return 0;
    return sizeof(drv_ring_t) + 64 + capacity * sizeof(slot_t);
}

drv_ring_t* drv_ring_create(size_t capacity, void* block, size_t bytes) {
    size_t need = drv_ring_memsize(capacity);
    if (need == 0 || block == NULL || bytes < need) return NULL;
    uintptr_t start = ((uintptr_t)block + 63) & ~(uintptr_t)63;
    drv_ring_t* self = (drv_ring_t*)start;
    self->mask = capacity - 1;
    self->slots = (slot_t*)(self + 1);
    self->expected = 0;
    self->missed = 0;
    atomic_init(&self->head, 0);
    atomic_init(&self->tail, 0);
    atomic_init(&self->overrun, 0);
    return self;
}

static void store(slot_t* slot, const drv_frame_t* frame) {
    uint64_t words[WORDS];
    memcpy(words, frame, sizeof words);
    for (int i = 0; i < WORDS; ++i) atomic_store_explicit(&slot->words[i], words[i], memory_order_release);
}

static void load(slot_t* slot, drv_frame_t* frame) {
    uint64_t words[WORDS];
    for (int i = 0; i < WORDS; ++i) words[i] = atomic_load_explicit(&slot->words[i], memory_order_acquire);
    memcpy(frame, words, sizeof words); // cppcheck-suppress uninitvar ; the loop before has written every word
}

/// Frames before `first` are given up. @return how many that were
static size_t give_up(drv_ring_t* self, size_t head, size_t first) {
    size_t tail = atomic_load_explicit(&self->tail, memory_order_acquire);
    while (head - tail > head - first) // the reader may move on meanwhile
        if (atomic_compare_exchange_weak_explicit(&self->tail, &tail, first, memory_order_acq_rel,
                                                  memory_order_acquire))
            return first - tail;
    return 0;
}

size_t drv_ring_push(drv_ring_t* self, const drv_frame_t* frames, size_t count) {
    const size_t capacity = self->mask + 1;
    size_t head = atomic_load_explicit(&self->head, memory_order_relaxed), lost = 0;
    while (count > 0) {
        const size_t piece = count < capacity ? count : capacity;
        if (head + piece - atomic_load_explicit(&self->tail, memory_order_acquire) > capacity)
            lost += give_up(self, head, head + piece - capacity);
        for (size_t i = 0; i < piece; ++i) store(&self->slots[(head + i) & self->mask], &frames[i]);
        head += piece;
        frames += piece;
        count -= piece;
        atomic_store_explicit(&self->head, head, memory_order_release);
    }
    if (lost > 0) atomic_fetch_add_explicit(&self->overrun, lost, memory_order_relaxed);
    return lost;
}

size_t drv_ring_pop(drv_ring_t* self, drv_frame_t* frames, size_t capacity) {
    size_t tail = atomic_load_explicit(&self->tail, memory_order_acquire), taken;
    do {
        size_t ready = atomic_load_explicit(&self->head, memory_order_acquire) - tail;
        taken = capacity < ready ? capacity : ready;
        if (taken == 0) return 0;
        for (size_t i = 0; i < taken; ++i) load(&self->slots[(tail + i) & self->mask], &frames[i]);
    } while (!atomic_compare_exchange_strong_explicit(&self->tail, &tail, tail + taken, memory_order_acq_rel,
                                                      memory_order_acquire));
    if (tail != self->expected) frames[0].loss |= DRV_LOSS_DRIVER;
    self->missed += tail - self->expected;
    self->expected = tail + taken;
    return taken;
}

uint64_t drv_ring_missed(const drv_ring_t* self) { return self->missed; }

uint64_t drv_ring_overrun(const drv_ring_t* self) {
    return atomic_load_explicit(&((drv_ring_t*)self)->overrun, memory_order_relaxed);
}

size_t drv_ring_used(const drv_ring_t* self) {
    drv_ring_t* ring = (drv_ring_t*)self;
    size_t tail = atomic_load_explicit(&ring->tail, memory_order_acquire);
    size_t used = atomic_load_explicit(&ring->head, memory_order_acquire) - tail;
    return used < ring->mask + 1 ? used : ring->mask + 1; // the two are not read at one instant
}
