// SPDX-License-Identifier: MIT
#include "threads.hpp"

#include "error.hpp"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <sched.h>
#include <sys/mman.h>

namespace okid_host {
namespace {

void complain(std::atomic<bool>& reported, int reason, const char* key, const char* remedy) {
    if (reported.exchange(true)) return;
    say("okid: [realtime] {}: {}; the run goes on without; {}\n", key, std::strerror(reason), remedy);
}

} // namespace

void put_first(std::thread& thread, const realtime_config& wanted, double share) {
    static std::atomic<bool> priority_reported{false}, cpus_reported{false};
    if (wanted.priority > 0) {
        sched_param before{};
        before.sched_priority = std::max(1, static_cast<int>(std::lround(wanted.priority * share)));
        const int reason = pthread_setschedparam(thread.native_handle(), SCHED_FIFO, &before);
        if (reason && wanted.priority_asked)
            complain(priority_reported, reason, "priority",
                     "a user needs an rtprio limit that high, a service LimitRTPRIO: see okid doctor");
    }
    if (wanted.cpus.empty()) return;
    cpu_set_t set;
    CPU_ZERO(&set);
    for (const int cpu : wanted.cpus) CPU_SET(static_cast<std::size_t>(cpu), &set);
    const int reason = pthread_setaffinity_np(thread.native_handle(), sizeof set, &set);
    if (reason)
        complain(cpus_reported, reason, "cpus",
                 "expected processors that this computer has and that okid may use: see nproc");
}

void lock_memory(const realtime_config& wanted) {
    static std::atomic<bool> reported{false};
    if (!wanted.lock_memory || mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0) return;
    complain(reported, errno, "lock_memory",
             "a user needs a memlock limit of \"unlimited\", a service LimitMEMLOCK=infinity: see okid doctor");
}

} // namespace okid_host
