// SPDX-License-Identifier: MIT
// Arrays that end where a page begins that must not be touched, or begin where one ends: a read or a write one number
// too far is a fault.
#ifndef OKID_TEST_FENCED_HPP
#define OKID_TEST_FENCED_HPP

extern "C" {
#include <unity.h>
}
#include <cstddef>
#include <cstring>
#include <sys/mman.h>
#include <unistd.h>
#include <vector>

enum class fence { behind, before };

template <class T> class fenced {
  public:
    fenced(fence where, std::size_t count) : count_(count) {
        const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
        const std::size_t inside = (count * sizeof(T) + page - 1) / page * page;
        size_ = inside + page;
        void* map = mmap(nullptr, size_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        TEST_ASSERT_TRUE(map != MAP_FAILED);
        map_ = static_cast<unsigned char*>(map);
        unsigned char* const forbidden = where == fence::behind ? map_ + inside : map_;
        TEST_ASSERT_EQUAL(0, mprotect(forbidden, page, PROT_NONE));
        unsigned char* const first = where == fence::behind ? map_ + inside - count * sizeof(T) : map_ + page;
        at_ = reinterpret_cast<T*>(first);
        std::memset(first, 0xff, count * sizeof(T)); // numbers that are none
    }
    fenced(fence where, const std::vector<T>& values) : fenced(where, values.size()) {
        if (!values.empty()) std::memcpy(at_, values.data(), values.size() * sizeof(T));
    }
    fenced(const fenced&) = delete;
    fenced& operator=(const fenced&) = delete;
    ~fenced() { munmap(map_, size_); }

    operator T*() const { return at_; }
    std::size_t size() const { return count_; }

  private:
    std::size_t count_, size_ = 0;
    unsigned char* map_ = nullptr;
    T* at_ = nullptr;
};

/// The same with the fence on either side.
template <class Test> void on_both_sides(const Test& test) {
    test(fence::behind);
    test(fence::before);
}

#endif
