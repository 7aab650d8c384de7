// SPDX-License-Identifier: MIT
#include <drv/ring.h>

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

static void* block;
static drv_ring_t* ring;

static void make(size_t capacity) {
    size_t bytes = drv_ring_memsize(capacity);
    block = malloc(bytes);
    ring = drv_ring_create(capacity, block, bytes);
    TEST_ASSERT_NOT_NULL(ring);
}

void setUp(void) { block = NULL; }
void tearDown(void) { free(block); }

static drv_frame_t numbered(uint32_t id) {
    drv_frame_t frame;
    memset(&frame, 0, sizeof frame);
    frame.id = id;
    return frame;
}

static void test_sizes(void) {
    TEST_ASSERT_EQUAL_UINT64(0, drv_ring_memsize(0));
    TEST_ASSERT_EQUAL_UINT64(0, drv_ring_memsize(1));
    TEST_ASSERT_EQUAL_UINT64(0, drv_ring_memsize(48));
    size_t bytes = drv_ring_memsize(64);
    block = malloc(bytes);
    TEST_ASSERT_NULL(drv_ring_create(64, block, bytes - 1));
    TEST_ASSERT_NULL(drv_ring_create(64, NULL, bytes));
    TEST_ASSERT_NOT_NULL(drv_ring_create(64, block, bytes));
}

/// A full ring gives its oldest frames up, counts them, and the oldest survivor says so.
static void test_the_oldest_make_room(void) {
    make(4);
    drv_frame_t in[6], out[8];
    for (uint32_t i = 0; i < 6; ++i) in[i] = numbered(i);
    TEST_ASSERT_EQUAL_UINT64(2, drv_ring_push(ring, in, 6));
    TEST_ASSERT_EQUAL_UINT64(2, drv_ring_overrun(ring));
    TEST_ASSERT_EQUAL_UINT64(4, drv_ring_used(ring));
    TEST_ASSERT_EQUAL_UINT64(1, drv_ring_push(ring, in, 1));
    TEST_ASSERT_EQUAL_UINT64(2, drv_ring_pop(ring, out, 2));
    TEST_ASSERT_EQUAL_UINT32(3, out[0].id);
    TEST_ASSERT_EQUAL_INT(DRV_LOSS_DRIVER, out[0].loss);
    TEST_ASSERT_EQUAL_UINT32(4, out[1].id);
    TEST_ASSERT_EQUAL_INT(0, out[1].loss);
    TEST_ASSERT_EQUAL_UINT64(3, drv_ring_missed(ring));
    TEST_ASSERT_EQUAL_UINT64(0, drv_ring_push(ring, in, 2));
    TEST_ASSERT_EQUAL_UINT64(4, drv_ring_pop(ring, out, 8));
    for (int i = 0; i < 4; ++i) TEST_ASSERT_EQUAL_INT(0, out[i].loss);
    TEST_ASSERT_EQUAL_UINT32(5, out[0].id);
    TEST_ASSERT_EQUAL_UINT32(1, out[3].id);
    TEST_ASSERT_EQUAL_UINT64(0, drv_ring_pop(ring, out, 8));
    TEST_ASSERT_EQUAL_UINT64(3, drv_ring_overrun(ring));
}

/// More at once than the ring holds, and a frame that carries a loss already.
static void test_one_push_beyond_the_capacity(void) {
    make(4);
    drv_frame_t in[11], out[8];
    for (uint32_t i = 0; i < 11; ++i) {
        in[i] = numbered(i);
        in[i].loss = DRV_LOSS_LINK;
    }
    TEST_ASSERT_EQUAL_UINT64(7, drv_ring_push(ring, in, 11));
    TEST_ASSERT_EQUAL_UINT64(4, drv_ring_pop(ring, out, 8));
    for (uint32_t i = 0; i < 4; ++i) TEST_ASSERT_EQUAL_UINT32(7 + i, out[i].id);
    TEST_ASSERT_EQUAL_INT(DRV_LOSS_LINK | DRV_LOSS_DRIVER, out[0].loss);
    TEST_ASSERT_EQUAL_INT(DRV_LOSS_LINK, out[1].loss);
    TEST_ASSERT_EQUAL_UINT64(7, drv_ring_missed(ring));
}

enum { FRAMES = 200000, RING = 64 };

typedef struct writer_plan_t {
    int waits; ///< for room
    atomic_int ended;
} writer_plan_t;

/// A frame whose every byte follows from its number: a torn copy shows.
static drv_frame_t filled(uint32_t id) {
    drv_frame_t frame;
    memset(&frame, (int)(id * 37 & 0xFF), sizeof frame);
    frame.id = id;
    frame.loss = 0;
    return frame;
}

static void* write_all(void* given) {
    writer_plan_t* plan = given;
    for (uint32_t i = 0; i < FRAMES;) {
        drv_frame_t batch[7];
        size_t count = 1 + i % 7;
        if (count > FRAMES - i) count = FRAMES - i;
        for (size_t k = 0; k < count; ++k) batch[k] = filled(i + (uint32_t)k);
        while (plan->waits && drv_ring_used(ring) + count > RING) sched_yield();
        drv_ring_push(ring, batch, count);
        i += (uint32_t)count;
        if (!plan->waits && i % 1024 < 7) sched_yield();
    }
    atomic_store(&plan->ended, 1);
    return NULL;
}

/// Read until the writer is done. Every frame whole and in order, a loss marked where it is and only there.
static void read_all(int waits) {
    make(RING);
    writer_plan_t plan = {.waits = waits};
    pthread_t writer;
    TEST_ASSERT_EQUAL_INT(0, pthread_create(&writer, NULL, write_all, &plan));
    drv_frame_t out[16];
    uint64_t next = 0, missed = 0, wrong = 0;
    for (;;) {
        const int last = atomic_load(&plan.ended);
        size_t count = drv_ring_pop(ring, out, 16);
        if (count == 0 && last) break;
        if (count == 0) sched_yield();
        for (size_t i = 0; i < count; ++i) {
            const uint64_t gap = out[i].id - next;
            missed += gap;
            wrong += out[i].loss != (gap ? DRV_LOSS_DRIVER : 0) || (i > 0 && gap);
            drv_frame_t whole = filled(out[i].id);
            whole.loss = out[i].loss;
            wrong += memcmp(&whole, &out[i], sizeof whole) != 0;
            next = (uint64_t)out[i].id + 1;
        }
        if (count > 0) wrong += missed != drv_ring_missed(ring);
    }
    pthread_join(writer, NULL);
    TEST_ASSERT_EQUAL_UINT64(0, wrong);
    TEST_ASSERT_EQUAL_UINT64(FRAMES, next);
    TEST_ASSERT_EQUAL_UINT64(missed, drv_ring_overrun(ring));
    if (waits) TEST_ASSERT_EQUAL_UINT64(0, missed);
}

static void test_two_threads_keep_order(void) { read_all(1); }
static void test_two_threads_and_a_slow_reader(void) { read_all(0); }

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_sizes);
    RUN_TEST(test_the_oldest_make_room);
    RUN_TEST(test_one_push_beyond_the_capacity);
    RUN_TEST(test_two_threads_keep_order);
    RUN_TEST(test_two_threads_and_a_slow_reader);
    return UNITY_END();
}
