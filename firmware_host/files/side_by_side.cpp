// SPDX-License-Identifier: MIT
// PURPOSE  independent pieces of work on several threads
// METHOD   each thread takes the next piece until none is left; the calling thread is one of them
#include "side_by_side.hpp"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <vector>

namespace okid_host {

void side_by_side(std::size_t count, int threads, const std::function<void(std::size_t)>& work) {
    const std::size_t wanted = threads > 0 ? static_cast<std::size_t>(threads) : std::thread::hardware_concurrency();
    std::atomic<std::size_t> next{0};
    std::exception_ptr failed;
    std::mutex failing;
    const auto run = [&] {
        for (std::size_t i = next++; i < count; i = next++) try {
                work(i);
            } catch (...) {
                const std::lock_guard<std::mutex> alone(failing);
                if (!failed) failed = std::current_exception();
                next = count;
            }
    };
    std::vector<std::thread> others;
    for (std::size_t k = 1; k < std::min(wanted, count); ++k) others.push_back(quiet_thread(run));
    run();
    for (std::thread& other : others) other.join();
    if (failed) std::rethrow_exception(failed);
}

} // namespace okid_host
