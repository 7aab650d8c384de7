// SPDX-License-Identifier: MIT
// PURPOSE  frames off a CAN interface, every loss counted and placed
// METHOD   recvmmsg of 64 frames a call; the kernel's drop counter rides on each frame (SO_RXQ_OVFL), the lost tail is
//          read from SO_MEMINFO at stats and close. What is polled is an epoll set of the socket and of a netlink socket
//          that hears of every change of the interface: one that vanished is bound again as soon as it is back.
//          The controller's own counters (netlink) are read once a second and whenever it sends an error message.
#include <drv/can_error.h>
#include <drv/host_clock.h>
#include <drv/link.h>
#include <drv/source.h>

#include <errno.h>
#include <time.h>

#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <linux/errqueue.h>
#include <linux/net_tstamp.h>
#include <linux/sock_diag.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

enum { BATCH = 64, CONTROL_BYTES = 256 };

static const int64_t look_ns = 1000000000; // how old the controller's counters may be

typedef struct socketcan_t {
    int fd;
    int poll_fd;       ///< epoll set of fd and watch_fd
    int watch_fd;      ///< reports changes of interfaces, -1 = no netlink
    int gone;          ///< the interface vanished: bind again when it is back
    int behind;        ///< the link was lost behind frames that still wait in the socket: its error comes before them
    int bound;         ///< index of the interface the socket is bound to
    uint32_t counted;  ///< the kernel's drop counter of this socket, as far as it stands in the counts
    uint32_t placed;   ///< the same as of the frame delivered last
    uint8_t loss;      ///< DRV_LOSS_… of the next frame
    int64_t looked_ns; ///< CLOCK_MONOTONIC of the last look at the controller
    uint64_t driver_dropped, driver_overran; ///< since open, by the controller's counters
    drv_host_clock_t clock;
    drv_link_t link; ///< as last read; its counters are the base of the next difference
    char interface[DRV_NAME_BYTES];
    char adapter[sizeof(((drv_usb_t*)0)->serial)]; ///< its interface is looked for at every opening, "" = by name
    int32_t adapter_channel;
    struct can_filter filters[DRV_MAX_FILTERS];
    int filter_count;
    int buffer_bytes;
    struct mmsghdr messages[BATCH];
    struct iovec pieces[BATCH];
    struct canfd_frame frames[BATCH];
    _Alignas(8) uint8_t control[BATCH][CONTROL_BYTES];
} socketcan_t;

static int explain(drv_source_t* self, int code, const char* interface, const char* text) {
    snprintf(self->error, sizeof self->error, "interface %s: %s", interface, text);
    return -code;
}

static void ask_for_buffer(drv_source_t* self, int fd, int bytes) {
    if (setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &bytes, sizeof bytes) != 0)
        (void)setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes);
    int granted = 0;
    socklen_t length = sizeof granted;
    if (getsockopt(fd, SOL_SOCKET, SO_RCVBUF, &granted, &length) == 0)
        self->counts.buffer_bytes = granted / 2; // the kernel doubles what was asked for, for its own overhead
}

static void ask_for_stamps(drv_source_t* self, int fd) {
    int on = 1;
    int kinds = SOF_TIMESTAMPING_RX_SOFTWARE | SOF_TIMESTAMPING_SOFTWARE | SOF_TIMESTAMPING_RX_HARDWARE |
                SOF_TIMESTAMPING_RAW_HARDWARE;
    if (setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPING, &kinds, sizeof kinds) == 0)
        self->counts.stamp = DRV_STAMP_NS;
    else if (setsockopt(fd, SOL_SOCKET, SO_TIMESTAMP, &on, sizeof on) == 0)
        self->counts.stamp = DRV_STAMP_US;
    else
        self->counts.stamp = DRV_STAMP_NONE;
}

/// Options of a fresh socket; the old kernel that lacks one of them still delivers frames.
static void set_options(drv_source_t* self, const socketcan_t* state, int fd) {
    int on = 1;
    can_err_mask_t errors = CAN_ERR_MASK;
    (void)setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on);
    (void)setsockopt(fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors);
    (void)setsockopt(fd, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
    if (state->filter_count > 0)
        (void)setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, state->filters,
                         (socklen_t)((size_t)state->filter_count * sizeof state->filters[0]));
    ask_for_buffer(self, fd, state->buffer_bytes);
    ask_for_stamps(self, fd);
}

/// The name that the adapter's interface has now. @return 0 or -errno with the reason
static int find_interface(drv_source_t* self, socketcan_t* state) {
    if (state->adapter[0] == '\0') return 0;
    int code = drv_link_find("/sys", state->adapter, state->adapter_channel, state->interface);
    if (code == 0) return 0;
    if (code == -ENOTUNIQ)
        snprintf(self->error, sizeof self->error, "adapter %s: several have this serial number, name the port instead",
                 state->adapter);
    else
        snprintf(self->error, sizeof self->error, "adapter %s: no such USB adapter has a CAN interface %d",
                 state->adapter, (int)state->adapter_channel);
    return code;
}

/// What the interface is now. By netlink: an ioctl with a name that is not there makes the kernel start modprobe, twice when
/// root asks, and wait for it. @return 0 or -errno
static int look_at_interface(int fd, const char* name, drv_link_t* out) {
    const int code = drv_link_read(name, out);
    if (code == 0 || code == -ENODEV) return code;
    struct ifreq request; // no netlink
    memset(&request, 0, sizeof request);
    memcpy(request.ifr_name, name, strlen(name));
    if (ioctl(fd, SIOCGIFHWADDR, &request) != 0) return -errno;
    out->is_can = request.ifr_hwaddr.sa_family == ARPHRD_CAN;
    if (ioctl(fd, SIOCGIFFLAGS, &request) != 0) return -errno;
    out->up = (request.ifr_flags & IFF_UP) != 0;
    if (ioctl(fd, SIOCGIFINDEX, &request) != 0) return -errno;
    out->index = request.ifr_ifindex;
    return 0;
}

/// A bound socket, or -errno with the reason.
static int make_socket(drv_source_t* self, socketcan_t* state, int* up) {
    int fd = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW);
    if (fd < 0) {
        int code = errno;
        if (code == EAFNOSUPPORT || code == EPROTONOSUPPORT)
            return explain(self, EAFNOSUPPORT, state->interface, "this kernel has no CAN (no AF_CAN or no can-raw)");
        return explain(self, code, state->interface, strerror(code));
    }
    drv_link_t link;
    int code = -look_at_interface(fd, state->interface, &link);
    const char* why = "there is no such interface";
    if (code == 0 && !link.is_can) code = ENODEV, why = "is not a CAN interface";
    if (code == 0) {
        *up = link.up;
        set_options(self, state, fd);
        struct sockaddr_can address;
        memset(&address, 0, sizeof address);
        address.can_family = AF_CAN;
        address.can_ifindex = state->bound = link.index;
        if (bind(fd, (struct sockaddr*)&address, sizeof address) != 0) code = errno;
    }
    if (code == 0) {
        memcpy(self->counts.interface, state->interface, sizeof state->interface);
        return fd;
    }
    close(fd);
    return explain(self, code, state->interface, code == ENODEV ? why : strerror(code));
}

static void lay_out_batch(socketcan_t* state) {
    for (int i = 0; i < BATCH; ++i) {
        state->pieces[i].iov_base = &state->frames[i];
        state->pieces[i].iov_len = sizeof state->frames[i];
        state->messages[i].msg_hdr.msg_iov = &state->pieces[i];
        state->messages[i].msg_hdr.msg_iovlen = 1;
        state->messages[i].msg_hdr.msg_control = state->control[i];
    }
}

static int add_to_poll_set(const socketcan_t* state, int fd) {
    struct epoll_event event;
    memset(&event, 0, sizeof event);
    event.events = EPOLLIN;
    event.data.fd = fd;
    return epoll_ctl(state->poll_fd, EPOLL_CTL_ADD, fd, &event);
}

/// Without netlink the source serves all the same; then the caller's time-out finds the interface again.
static int make_poll_set(drv_source_t* self, socketcan_t* state) {
    state->watch_fd = drv_link_watch();
    state->poll_fd = epoll_create1(EPOLL_CLOEXEC);
    if (state->poll_fd >= 0 && add_to_poll_set(state, state->fd) == 0 &&
        (state->watch_fd < 0 || add_to_poll_set(state, state->watch_fd) == 0))
        return 0;
    int code = errno;
    if (state->watch_fd >= 0) close(state->watch_fd);
    if (state->poll_fd >= 0) close(state->poll_fd);
    close(state->fd);
    return explain(self, code, state->interface, strerror(code));
}

static int64_t monotonic_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static void count_driver_losses(drv_source_t* self, socketcan_t* state) {
    uint64_t overran =
        self->counts.rx_overflows > state->driver_overran ? self->counts.rx_overflows : state->driver_overran;
    uint64_t lost = state->driver_dropped + overran;
    if (lost > self->counts.lost_driver) state->loss |= DRV_LOSS_DRIVER;
    self->counts.lost_driver = lost;
}

/// Take in what the driver tells of the controller. Its overruns come as error messages too: the larger count holds.
static void take_link(drv_source_t* self, socketcan_t* state, const drv_link_t* link) {
    drv_stats_t* counts = &self->counts;
    if (link->index == state->link.index) { // a device that was made again counts from 0
        uint64_t dropped = link->rx_dropped - state->link.rx_dropped,
                 overran = link->rx_over_errors - state->link.rx_over_errors;
        if (link->rx_dropped >= state->link.rx_dropped) state->driver_dropped += dropped;
        if (link->rx_over_errors >= state->link.rx_over_errors) state->driver_overran += overran;
    }
    state->link = *link;
    if (link->has_can_data) {
        counts->state = link->state;
        counts->restart_ms = link->restart_ms;
        counts->bitrate = link->bitrate;
    }
    count_driver_losses(self, state);
}

static void look_at_controller(drv_source_t* self, socketcan_t* state) {
    drv_link_t link;
    state->looked_ns = monotonic_ns();
    if (drv_link_read(state->interface, &link) == 0) take_link(self, state, &link);
}

static int socketcan_open(drv_source_t* self, const drv_source_config_t* config) {
    memset(&self->counts, 0, sizeof self->counts);
    self->error[0] = '\0';
    self->state = NULL;
    const char* name = config->interface_count > 0 ? config->interfaces[0] : "";
    const char* adapter = config->adapter;
    if (adapter && (adapter[0] == '\0' || strlen(adapter) >= sizeof(((socketcan_t*)0)->adapter)))
        return explain(self, EINVAL, adapter, "serial number or port of a USB adapter: 1 to 127 characters");
    if (!adapter && (name[0] == '\0' || strlen(name) >= DRV_NAME_BYTES))
        return explain(self, EINVAL, name, "an interface name has 1 to 15 characters");
    if (config->filter_count > DRV_MAX_FILTERS)
        return explain(self, EINVAL, name, "at most 512 identifiers can be asked for");
    socketcan_t* state = calloc(1, sizeof *state);
    if (!state) return explain(self, ENOMEM, name, "out of memory");
    if (adapter)
        memcpy(state->adapter, adapter, strlen(adapter));
    else
        memcpy(state->interface, name, strlen(name));
    state->adapter_channel = config->adapter_channel;
    state->buffer_bytes = config->buffer_bytes > 0 ? config->buffer_bytes : DRV_RECEIVE_BUFFER;
    state->filter_count = config->filters ? config->filter_count : 0;
    for (int i = 0; i < state->filter_count; ++i) {
        int extended = config->filters[i].extended;
        state->filters[i].can_id = config->filters[i].id | (extended ? CAN_EFF_FLAG : 0);
        const uint32_t all = extended ? CAN_EFF_MASK : CAN_SFF_MASK, some = config->filters[i].mask;
        state->filters[i].can_mask = (some ? some : all) | CAN_EFF_FLAG | CAN_RTR_FLAG;
    }
    lay_out_batch(state);
    (void)drv_host_clock_look_now(&state->clock);
    int up = 0, code = find_interface(self, state);
    if (code == 0) {
        state->fd = make_socket(self, state, &up);
        code = state->fd < 0 ? state->fd : 0;
    }
    if (code == 0 && !up) {
        close(state->fd);
        code = explain(self, ENETDOWN, state->interface, "is down");
    }
    if (code == 0) code = make_poll_set(self, state);
    if (code) {
        free(state);
        return code;
    }
    self->state = state;
    look_at_controller(self, state);
    return 0;
}

static int socketcan_fd(const drv_source_t* self) {
    const socketcan_t* state = self->state;
    return state ? state->poll_fd : -1;
}

/// Take in the kernel's drop counter (it wraps). @return frames dropped since last time
static uint32_t account_drops(drv_source_t* self, socketcan_t* state, uint32_t now) {
    uint32_t more = now - state->counted;
    if (more > UINT32_MAX / 2) return 0; // an older value: the socket's own counter was read in between
    self->counts.lost_overflow += more;
    state->counted = now;
    return more;
}

/// The counter of the socket itself, frames that were dropped after the last one delivered included.
static void read_drop_counter(drv_source_t* self, socketcan_t* state) {
    uint32_t info[SK_MEMINFO_VARS] = {0};
    socklen_t length = sizeof info;
    if (getsockopt(state->fd, SOL_SOCKET, SO_MEMINFO, info, &length) != 0) return;
    if (length > SK_MEMINFO_DROPS * sizeof info[0]) (void)account_drops(self, state, info[SK_MEMINFO_DROPS]);
}

/// The counter as it stood when this frame was queued: drops stand before it.
static void place_drops(drv_source_t* self, socketcan_t* state, uint32_t now) {
    (void)account_drops(self, state, now);
    if (now != state->placed) state->loss |= DRV_LOSS_OVERFLOW;
    state->placed = now;
}

/// The interface is down or gone. Frames that wait in the socket came before that.
static void link_lost(drv_source_t* self, socketcan_t* state, int gone, int behind) {
    if (!self->counts.link_is_down) ++self->counts.link_down;
    self->counts.link_is_down = 1;
    state->behind = behind;
    if (!behind) state->loss |= DRV_LOSS_LINK;
    if (gone && !state->gone) {
        read_drop_counter(self, state);
        (void)epoll_ctl(state->poll_fd, EPOLL_CTL_DEL, state->fd, NULL);
        state->gone = 1;
    }
}

/// Bind again when the interface is back. @return 1 when it is
static int try_again(drv_source_t* self, socketcan_t* state) {
    int up = 0;
    if (find_interface(self, state) != 0) return 0;
    int fd = make_socket(self, state, &up);
    if (fd < 0) return 0;
    if (add_to_poll_set(state, fd) != 0) {
        close(fd);
        return 0;
    }
    close(state->fd); // leaves the poll set with it
    state->fd = fd;
    state->gone = 0;
    state->counted = state->placed = 0;
    ++self->counts.reopened;
    self->counts.link_is_down = !up;
    self->error[0] = '\0';
    return 1;
}

/// Nothing was to be read: has the interface changed?
static void hear_of_link(drv_source_t* self, socketcan_t* state) {
    drv_link_t link;
    struct pollfd news = {.fd = state->watch_fd, .events = POLLIN};
    if (state->watch_fd < 0 || poll(&news, 1, 0) <= 0) return;
    // A name can change under the socket; that of an adapter which is away may belong to another one by now.
    if (state->adapter[0] && !state->gone && if_indextoname((unsigned)state->bound, state->interface))
        memcpy(self->counts.interface, state->interface, sizeof state->interface);
    if (!drv_link_changes(state->watch_fd, state->interface, &link)) return;
    if (state->adapter[0] && state->gone) return;
    if (link.gone) return; // the socket says so itself
    // News may be old: down while it was renamed, up and heard by now; of the interface that had this name before.
    if ((link.index != state->bound || !link.up) && drv_link_read(state->interface, &link) != 0) return;
    int renamed = link.index != state->bound;
    if (renamed || !link.up)
        link_lost(self, state, renamed, !renamed && state->behind);
    else
        self->counts.link_is_down = state->gone;
    take_link(self, state, &link);
}

static void take_stamp(drv_frame_t* frame, const struct cmsghdr* part) {
    if (part->cmsg_type == SCM_TIMESTAMPING) {
        struct scm_timestamping stamps;
        memcpy(&stamps, CMSG_DATA(part), sizeof stamps);
        frame->time_ns = (int64_t)stamps.ts[0].tv_sec * 1000000000 + stamps.ts[0].tv_nsec;
        frame->hw_time_ns = (int64_t)stamps.ts[2].tv_sec * 1000000000 + stamps.ts[2].tv_nsec;
    } else if (part->cmsg_type == SCM_TIMESTAMP) {
        struct timeval stamp;
        memcpy(&stamp, CMSG_DATA(part), sizeof stamp);
        frame->time_ns = ((int64_t)stamp.tv_sec * 1000000 + stamp.tv_usec) * 1000;
    }
}

static void take_control(drv_source_t* self, socketcan_t* state, struct msghdr* header, drv_frame_t* frame) {
    for (struct cmsghdr* part = CMSG_FIRSTHDR(header); part; part = CMSG_NXTHDR(header, part)) {
        if (part->cmsg_level != SOL_SOCKET) continue;
        if (part->cmsg_type == SO_RXQ_OVFL) {
            uint32_t dropped;
            memcpy(&dropped, CMSG_DATA(part), sizeof dropped);
            place_drops(self, state, dropped);
        } else {
            take_stamp(frame, part);
        }
    }
    if (frame->hw_time_ns) self->counts.stamp = DRV_STAMP_HARDWARE;
    frame->time_ns = frame->time_ns ? drv_host_clock_carry(&state->clock, frame->time_ns) : drv_host_time_ns();
}

static void take_error_frame(drv_source_t* self, socketcan_t* state, const struct canfd_frame* raw) {
    drv_can_error_count(&self->counts, raw->can_id & CAN_ERR_MASK, raw->data);
    count_driver_losses(self, state);
}

/// One received message to a frame. @return 1, or 0 when it is no data
static int take_message(drv_source_t* self, socketcan_t* state, int index, drv_frame_t* frame) {
    const struct canfd_frame* raw = &state->frames[index];
    struct mmsghdr* message = &state->messages[index];
    int fd_frame = message->msg_len == CANFD_MTU;
    if (!fd_frame && message->msg_len != CAN_MTU) {
        ++self->counts.read_errors;
        return 0;
    }
    memset(frame, 0, offsetof(drv_frame_t, data));
    take_control(self, state, &message->msg_hdr, frame);
    if (raw->can_id & CAN_ERR_FLAG) {
        take_error_frame(self, state, raw);
        return 0;
    }
    if (raw->can_id & CAN_RTR_FLAG) {
        ++self->counts.remote;
        return 0;
    }
    int extended = (raw->can_id & CAN_EFF_FLAG) != 0;
    frame->id = raw->can_id & (extended ? CAN_EFF_MASK : CAN_SFF_MASK);
    frame->flags = (uint8_t)((extended ? DRV_FRAME_EXTENDED : 0) | (fd_frame ? DRV_FRAME_FD : 0));
    if (fd_frame && raw->flags & CANFD_BRS) frame->flags |= DRV_FRAME_BRS;
    if (fd_frame && raw->flags & CANFD_ESI) frame->flags |= DRV_FRAME_ESI;
    unsigned most = fd_frame ? 64 : 8;
    frame->len = (uint8_t)(raw->len < most ? raw->len : most);
    memcpy(frame->data, raw->data, fd_frame ? 64 : 8);
    frame->loss = state->loss;
    state->loss = 0;
    if (!state->behind) self->counts.link_is_down = 0;
    ++self->counts.received;
    return 1;
}

/// The socket failed. @return 0 when the interface explains it, else -errno
static int socket_failed(drv_source_t* self, socketcan_t* state, int code) {
    if (code == EAGAIN || code == EWOULDBLOCK) {
        if (state->behind) state->loss |= DRV_LOSS_LINK;
        state->behind = 0;
        return 0;
    }
    if (code == EINTR) return 0;
    if (code == ENETDOWN || code == ENODEV || code == ENXIO) {
        link_lost(self, state, code != ENETDOWN, code == ENETDOWN);
        return 0;
    }
    ++self->counts.read_errors;
    if (code != ENOBUFS && code != ENOMEM) link_lost(self, state, 1, 0); // whatever it is: a fresh socket
    return explain(self, code, state->interface, strerror(code));
}

static int receive(socketcan_t* state, int capacity) {
    int batch = capacity < BATCH ? capacity : BATCH;
    for (int i = 0; i < batch; ++i) {
        state->messages[i].msg_hdr.msg_controllen = CONTROL_BYTES;
        state->messages[i].msg_hdr.msg_flags = 0;
    }
    int got = recvmmsg(state->fd, state->messages, (unsigned)batch, MSG_DONTWAIT, NULL);
    return got < 0 ? -errno : got;
}

static int socketcan_read(drv_source_t* self, drv_frame_t* frames, int capacity) {
    socketcan_t* state = self->state;
    if (!state) return -EBADF;
    int got = state->gone ? -ENODEV : receive(state, capacity);
    if (got < 0) {
        int code = state->gone ? 0 : socket_failed(self, state, -got);
        hear_of_link(self, state);
        if (!state->gone || !try_again(self, state)) return code;
        got = receive(state, capacity);
        if (got < 0) return socket_failed(self, state, -got);
    }
    if (got > 0) (void)drv_host_clock_look_now(&state->clock);
    int count = 0;
    for (int i = 0; i < got; ++i) count += take_message(self, state, i, &frames[count]);
    return count;
}

static void socketcan_stats(drv_source_t* self, drv_stats_t* out) {
    socketcan_t* state = self->state;
    if (state) {
        read_drop_counter(self, state);
        if (monotonic_ns() - state->looked_ns >= look_ns) look_at_controller(self, state);
    }
    *out = self->counts;
}

static void socketcan_close(drv_source_t* self) {
    socketcan_t* state = self->state;
    if (!state) return;
    read_drop_counter(self, state);
    look_at_controller(self, state);
    close(state->poll_fd);
    if (state->watch_fd >= 0) close(state->watch_fd);
    close(state->fd);
    free(state);
    self->state = NULL;
}

const drv_source_ops_t drv_source_socketcan = {socketcan_open, socketcan_fd, socketcan_read, socketcan_stats,
                                               socketcan_close};
