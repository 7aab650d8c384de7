// SPDX-License-Identifier: MIT
// Numbered frames onto a CAN interface in batches, at absolute deadlines or as fast as it takes them.
// usage: vcan_flood INTERFACE COUNT FRAMES_PER_SECOND(0 = flat out) classic|fd
#include <drv/pacer.h>

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <unistd.h>

enum { BATCH = 64 };

static int open_socket(const char* interface) {
    struct sockaddr_can address;
    memset(&address, 0, sizeof address);
    address.can_family = AF_CAN;
    address.can_ifindex = (int)if_nametoindex(interface);
    const int on = 1, fd = socket(PF_CAN, SOCK_RAW, CAN_RAW);
    if (fd < 0 || setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) != 0 ||
        setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, NULL, 0) != 0 ||
        bind(fd, (struct sockaddr*)&address, sizeof address) != 0)
        return -1;
    return fd;
}

/// All of a batch, however often the interface has to be asked.
static int send_batch(int fd, struct mmsghdr* messages, unsigned count) {
    for (unsigned sent = 0; sent < count;) {
        const int done = sendmmsg(fd, messages + sent, count - sent, 0);
        if (done > 0)
            sent += (unsigned)done;
        else if (errno == ENOBUFS || errno == EAGAIN)
            usleep(200);
        else if (errno != EINTR)
            return -1;
    }
    return 0;
}

int main(int argc, char** argv) {
    if (argc != 5) return 2;
    const long count = atol(argv[2]);
    const double rate = atof(argv[3]);
    const int is_fd = strcmp(argv[4], "fd") == 0;
    const int fd = open_socket(argv[1]);
    if (fd < 0) {
        perror(argv[1]);
        return 4;
    }
    static struct canfd_frame frames[BATCH];
    static struct iovec pieces[BATCH];
    static struct mmsghdr messages[BATCH];
    for (int i = 0; i < BATCH; ++i) {
        frames[i].can_id = 0x123;
        frames[i].len = is_fd ? 64 : 8;
        pieces[i].iov_base = &frames[i];
        pieces[i].iov_len = is_fd ? CANFD_MTU : CAN_MTU;
        messages[i].msg_hdr.msg_iov = &pieces[i];
        messages[i].msg_hdr.msg_iovlen = 1;
    }
    drv_pacer_t pacer;
    drv_pacer_start(&pacer, 1000000);
    for (long next = 0; next < count;) {
        unsigned batch = 0;
        for (; batch < BATCH && next < count; ++batch, ++next) {
            const uint32_t number = (uint32_t)next;
            memcpy(frames[batch].data, &number, sizeof number);
        }
        if (rate > 0) (void)drv_pacer_wait(&pacer, (int64_t)((double)(next - batch) * 1e9 / rate), NULL, NULL);
        if (send_batch(fd, messages, batch) != 0) {
            perror("sendmmsg");
            return 4;
        }
    }
    printf("{\"sent\": %ld, \"seconds\": %.3f}\n", count, (double)drv_pacer_now(&pacer) / 1e9);
    return 0;
}
