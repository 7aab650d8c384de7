// SPDX-License-Identifier: MIT
// Frames onto CAN interfaces in batches, at absolute deadlines or as fast as they take them: numbered ones, or those of a
// file for each interface (struct can_frame one behind the other, behind "fd:" struct canfd_frame).
// usage: vcan_flood INTERFACE[,INTERFACE] COUNT FRAMES_PER_SECOND(0 = flat out) classic|fd|[fd:]FILE[,[fd:]FILE]
// COUNT and FRAMES_PER_SECOND are those of one interface.
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

enum { BATCH = 64, MOST = 2 };

typedef struct stream_t {
    int fd;
    FILE* recorded; ///< NULL: numbered frames
    struct canfd_frame frames[BATCH];
    struct iovec pieces[BATCH];
    struct mmsghdr messages[BATCH];
} stream_t;

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

/// @return 0, or -1 when the interface or the file cannot be opened
static int begin(stream_t* self, const char* interface, const char* kind) {
    const int is_fd = strcmp(kind, "fd") == 0 || strncmp(kind, "fd:", 3) == 0;
    const int numbered = strcmp(kind, "fd") == 0 || strcmp(kind, "classic") == 0;
    self->fd = open_socket(interface);
    self->recorded = numbered ? NULL : fopen(strncmp(kind, "fd:", 3) == 0 ? kind + 3 : kind, "rb");
    for (int i = 0; i < BATCH; ++i) {
        self->frames[i].can_id = 0x123;
        self->frames[i].len = is_fd ? 64 : 8;
        self->pieces[i].iov_base = &self->frames[i];
        self->pieces[i].iov_len = is_fd ? CANFD_MTU : CAN_MTU;
        self->messages[i].msg_hdr.msg_iov = &self->pieces[i];
        self->messages[i].msg_hdr.msg_iovlen = 1;
    }
    return self->fd < 0 || (!numbered && !self->recorded) ? -1 : 0;
}

static int send_next(stream_t* self, long first, unsigned count) {
    for (unsigned i = 0; i < count; ++i) {
        const uint32_t number = (uint32_t)(first + i);
        if (!self->recorded)
            memcpy(self->frames[i].data, &number, sizeof number);
        else if (fread(&self->frames[i], self->pieces[i].iov_len, 1, self->recorded) != 1)
            return -1;
    }
    return send_batch(self->fd, self->messages, count);
}

int main(int argc, char** argv) {
    static stream_t streams[MOST];
    if (argc != 5) return 2;
    const long count = atol(argv[2]);
    const double rate = atof(argv[3]);
    int used = 0;
    char *rest_of_names = NULL, *rest_of_kinds = NULL;
    const char* name = strtok_r(argv[1], ",", &rest_of_names);
    const char* kind = strtok_r(argv[4], ",", &rest_of_kinds);
    for (; name && kind && used < MOST; ++used) {
        if (begin(&streams[used], name, kind) != 0) {
            perror(name);
            return 4;
        }
        name = strtok_r(NULL, ",", &rest_of_names);
        kind = strtok_r(NULL, ",", &rest_of_kinds);
    }
    drv_pacer_t pacer;
    drv_pacer_start(&pacer, 1000000);
    for (long next = 0; next < count;) {
        const unsigned batch = (unsigned)(count - next < BATCH ? count - next : BATCH);
        if (rate > 0) (void)drv_pacer_wait(&pacer, (int64_t)((double)next * 1e9 / rate), NULL, NULL);
        for (int i = 0; i < used; ++i)
            if (send_next(&streams[i], next, batch) != 0) {
                perror("sendmmsg");
                return 4;
            }
        next += batch;
    }
    printf("{\"sent\": %ld, \"seconds\": %.3f}\n", count, (double)drv_pacer_now(&pacer) / 1e9);
    return 0;
}
