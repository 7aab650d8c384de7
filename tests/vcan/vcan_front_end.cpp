// SPDX-License-Identifier: MIT
// okid's reader thread and ring on a CAN interface, and nothing behind it: what vcan_flood numbered is checked.
// usage: vcan_front_end INTERFACE COUNT QUIET_SECONDS   ends after COUNT frames or when QUIET_SECONDS bring none.
// "listening" when the socket is bound; "back NS" (CLOCK_MONOTONIC) for the first frame after the link was away.
#include "acquire/reader.hpp"

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>

namespace {

long long now_ns() {
    timespec now{};
    clock_gettime(CLOCK_MONOTONIC, &now);
    return static_cast<long long>(now.tv_sec) * 1000000000 + now.tv_nsec;
}

} // namespace

int main(int argc, char** argv) try {
    if (argc != 4) return 2;
    okid_host::live_config config;
    config.rate_hz = 1000;
    config.buses.resize(1);
    config.buses[0].interface = argv[1];
    const long long wanted = std::atoll(argv[2]);
    const double quiet_s = std::atof(argv[3]);
    okid_host::wake_event wake;
    okid_host::watermark mark;
    okid_host::bus_reader reader(config, 0, wake, mark);
    reader.start(config.realtime);
    std::printf("listening\n");
    std::fflush(stdout);
    std::vector<drv_frame_t> frames(512);
    long long received = 0, missing = 0, reordered = 0, next = 0, heard_ns = now_ns();
    while (received < wanted && static_cast<double>(now_ns() - heard_ns) < quiet_s * 1e9) {
        wake.wait(50);
        for (std::size_t got; (got = drv_ring_pop(reader.ring(), frames.data(), frames.size())) > 0;
             heard_ns = now_ns())
            for (std::size_t i = 0; i < got; ++i) {
                std::uint32_t number = 0;
                std::memcpy(&number, frames[i].data, sizeof number);
                if (frames[i].loss & DRV_LOSS_LINK) {
                    std::printf("back %lld\n", now_ns());
                    std::fflush(stdout);
                }
                ++received;
                reordered += number < next;
                missing += number > next ? number - next : 0;
                next = number + 1LL;
            }
    }
    reader.stop();
    const drv_stats_t stats = reader.stats();
    std::printf(
        "{\"received\": %lld, \"missing\": %lld, \"reordered\": %lld, \"socket_overflow\": %llu, \"ring\": %llu, "
        "\"link_down\": %llu, \"reopened\": %llu}\n",
        received, missing, reordered, static_cast<unsigned long long>(stats.lost_overflow),
        static_cast<unsigned long long>(reader.ring_overrun()), static_cast<unsigned long long>(stats.link_down),
        static_cast<unsigned long long>(stats.reopened));
    return 0;
} catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 4;
}
