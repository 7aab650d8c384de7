// SPDX-License-Identifier: MIT
#include <drv/ring.h>

#include <pthread.h>
#include <sched.h>
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

static void test_overrun_is_counted_and_placed(void) {
    make(4);
    drv_frame_t in[6], out[8];
    for (uint32_t i = 0; i < 6; ++i) in[i] = numbered(i);
    TEST_ASSERT_EQUAL_UINT64(4, drv_ring_push(ring, in, 6));
    TEST_ASSERT_EQUAL_UINT64(2, drv_ring_overrun(ring));
    TEST_ASSERT_EQUAL_UINT64(4, drv_ring_used(ring));
    TEST_ASSERT_EQUAL_UINT64(0, drv_ring_push(ring, in, 1));
    TEST_ASSERT_EQUAL_UINT64(4, drv_ring_pop(ring, out, 8));
    for (uint32_t i = 0; i < 4; ++i) {
        TEST_ASSERT_EQUAL_UINT32(i, out[i].id);
        TEST_ASSERT_EQUAL_INT(0, out[i].loss);
    }
    TEST_ASSERT_EQUAL_UINT64(2, drv_ring_push(ring, in, 2));
    TEST_ASSERT_EQUAL_UINT64(2, drv_ring_pop(ring, out, 8));
    TEST_ASSERT_EQUAL_INT(DRV_LOSS_DRIVER, out[0].loss);
    TEST_ASSERT_EQUAL_INT(0, out[1].loss);
    TEST_ASSERT_EQUAL_UINT64(3, drv_ring_overrun(ring));
    TEST_ASSERT_EQUAL_UINT64(0, drv_ring_pop(ring, out, 8));
}

enum { FRAMES = 200000 };

static void* write_all(void* ignored) {
    (void)ignored;
    for (uint32_t i = 0; i < FRAMES;) {
        drv_frame_t batch[7];
        size_t count = 1 + i % 7;
        if (count > FRAMES - i) count = FRAMES - i;
        for (size_t k = 0; k < count; ++k) batch[k] = numbered(i + (uint32_t)k);
        while (drv_ring_used(ring) + count > 64) sched_yield();
        i += (uint32_t)drv_ring_push(ring, batch, count);
    }
    return NULL;
}

static void test_two_threads_keep_order(void) {
    make(64);
    pthread_t writer;
    TEST_ASSERT_EQUAL_INT(0, pthread_create(&writer, NULL, write_all, NULL));
    drv_frame_t out[16];
    uint32_t next = 0;
    int in_order = 1;
    while (next < FRAMES) {
        size_t count = drv_ring_pop(ring, out, 16);
        if (count == 0) sched_yield();
        for (size_t i = 0; i < count; ++i) in_order &= out[i].id == next++;
    }
    pthread_join(writer, NULL);
    TEST_ASSERT_TRUE(in_order);
    TEST_ASSERT_EQUAL_UINT64(0, drv_ring_overrun(ring));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_sizes);
    RUN_TEST(test_overrun_is_counted_and_placed);
    RUN_TEST(test_two_threads_keep_order);
    return UNITY_END();
}
