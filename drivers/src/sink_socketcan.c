// SPDX-License-Identifier: MIT
// PURPOSE  send frames on a CAN interface
// METHOD   a CAN_RAW socket that receives nothing; a full queue answers ENOBUFS and poll() does not tell, so wait and retry
#include <drv/sink.h>

#include <errno.h>
#include <time.h>

#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

static int explain(drv_sink_t* self, int code, const char* interface, const char* text) {
    snprintf(self->error, sizeof self->error, "interface %s: %s", interface, text);
    if (self->fd >= 0) close(self->fd);
    self->fd = -1;
    return -code;
}

int drv_sink_open(drv_sink_t* self, const char* interface) {
    memset(self, 0, sizeof *self);
    self->fd = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
    if (self->fd < 0 && (errno == EAFNOSUPPORT || errno == EPROTONOSUPPORT))
        return explain(self, EAFNOSUPPORT, interface, "this kernel has no CAN (no AF_CAN or no can-raw)");
    if (self->fd < 0) return explain(self, errno, interface, strerror(errno));
    if (strlen(interface) >= DRV_NAME_BYTES)
        return explain(self, EINVAL, interface, "an interface name has at most 15 characters");
    int on = 1;
    (void)setsockopt(self->fd, SOL_CAN_RAW, CAN_RAW_FILTER, NULL, 0);
    (void)setsockopt(self->fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on);
    struct ifreq request;
    memset(&request, 0, sizeof request);
    memcpy(request.ifr_name, interface, strlen(interface));
    struct sockaddr_can address;
    memset(&address, 0, sizeof address);
    address.can_family = AF_CAN;
    address.can_ifindex = (int)if_nametoindex(interface);
    if (address.can_ifindex == 0) return explain(self, ENODEV, interface, "there is no such interface");
    if (bind(self->fd, (struct sockaddr*)&address, sizeof address) != 0)
        return explain(self, errno, interface, errno == ENODEV ? "is not a CAN interface" : strerror(errno));
    if (ioctl(self->fd, SIOCGIFFLAGS, &request) == 0 && !(request.ifr_flags & IFF_UP))
        return explain(self, ENETDOWN, interface, "is down");
    return 0;
}

int drv_sink_write(drv_sink_t* self, const drv_frame_t* frame, int patience_ms) {
    if (frame->flags & DRV_FRAME_ERROR) return 0;
    struct canfd_frame raw;
    memset(&raw, 0, sizeof raw);
    raw.can_id = frame->id | (frame->flags & DRV_FRAME_EXTENDED ? CAN_EFF_FLAG : 0) |
                 (frame->flags & DRV_FRAME_REMOTE ? CAN_RTR_FLAG : 0);
    raw.len = frame->len;
    if (frame->flags & DRV_FRAME_BRS) raw.flags |= CANFD_BRS;
    if (frame->flags & DRV_FRAME_ESI) raw.flags |= CANFD_ESI;
    if (!(frame->flags & DRV_FRAME_REMOTE)) memcpy(raw.data, frame->data, frame->len);
    size_t bytes = frame->flags & DRV_FRAME_FD ? CANFD_MTU : CAN_MTU;
    for (int waited_ms = 0;; ++waited_ms) {
        if (write(self->fd, &raw, bytes) == (ssize_t)bytes) {
            ++self->sent;
            return 0;
        }
        int code = errno;
        if (code == EINTR) continue;
        if ((code != ENOBUFS && code != EAGAIN) || waited_ms >= patience_ms) {
            snprintf(self->error, sizeof self->error, "frame %llu cannot be sent: %s%s",
                     (unsigned long long)self->sent + 1, strerror(code),
                     code == EINVAL && bytes == CANFD_MTU ? " (an FD frame on an interface with mtu 16?)" : "");
            return -code;
        }
        ++self->waits;
        struct timespec pause = {0, 1000000};
        (void)nanosleep(&pause, NULL);
    }
}

void drv_sink_close(drv_sink_t* self) {
    if (self->fd >= 0) close(self->fd);
    self->fd = -1;
}
