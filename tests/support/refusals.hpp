// SPDX-License-Identifier: MIT
// What a call needs, taken away piece by piece: each pointer alone is missing, each size alone is below its least.
#ifndef OKID_TEST_REFUSALS_HPP
#define OKID_TEST_REFUSALS_HPP

#include <okid/types.h>

extern "C" {
#include <unity.h>
}
#include <cstdint>
#include <cstring>
#include <initializer_list>

/// Where a pointer of any kind stands.
struct pointer_at {
    void* place;
    template <class T> pointer_at(T*& pointer) : place(&pointer) {} // a list of them stands in braces
};

struct least_of {
    int32_t* size;
    int32_t least;
};

template <class Call>
void each_pointer_is_needed(const char* name, const Call& call, std::initializer_list<pointer_at> pointers) {
    TEST_ASSERT_TRUE_MESSAGE(call() >= 0, name);
    for (const pointer_at& one : pointers) {
        void *kept = nullptr, *const none = nullptr;
        std::memcpy(&kept, one.place, sizeof kept);
        std::memcpy(one.place, &none, sizeof none);
        const okid_status_t status = call();
        std::memcpy(one.place, &kept, sizeof kept);
        TEST_ASSERT_EQUAL_MESSAGE(OKID_ERR_NULL, status, name);
    }
}

template <class Call>
void each_size_has_a_least(const char* name, const Call& call, std::initializer_list<least_of> sizes) {
    TEST_ASSERT_TRUE_MESSAGE(call() >= 0, name);
    for (const least_of& one : sizes) {
        const int32_t kept = *one.size;
        *one.size = one.least;
        const okid_status_t at = call();
        *one.size = one.least - 1;
        const okid_status_t below = call();
        *one.size = kept;
        TEST_ASSERT_NOT_EQUAL_MESSAGE(OKID_ERR_DIM, at, name);
        TEST_ASSERT_EQUAL_MESSAGE(OKID_ERR_DIM, below, name);
    }
}

/// Each value in the place of one that is fine.
template <class Number, class Call>
void each_value_is_refused(const char* name, const Call& call, Number& place, std::initializer_list<Number> values) {
    const Number kept = place;
    for (const Number value : values) {
        place = value;
        const okid_status_t status = call();
        place = kept;
        TEST_ASSERT_EQUAL_MESSAGE(OKID_ERR_DIM, status, name);
    }
    TEST_ASSERT_TRUE_MESSAGE(call() >= 0, name);
}

/// One byte less than asked for.
template <class Call> void every_byte_is_needed(const char* name, const Call& call, size_t& bytes) {
    --bytes;
    const okid_status_t status = call();
    ++bytes;
    TEST_ASSERT_EQUAL_MESSAGE(OKID_ERR_MEMORY, status, name);
}

#endif
