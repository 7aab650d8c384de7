// SPDX-License-Identifier: MIT
// A kernel with one CAN interface, in the test program itself: the system calls of the SocketCAN source end here, so that
// every answer a real kernel can give is at hand on a machine without CAN. Included by one source of a program.
#ifndef TESTS_FAULT_FAKE_CAN_H
#define TESTS_FAULT_FAKE_CAN_H

#include <errno.h>
#include <time.h>

#include <linux/can.h>
#include <linux/can/netlink.h>
#include <linux/can/raw.h>
#include <linux/errqueue.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include <linux/sock_diag.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

enum { FAKE_QUEUE = 1024, FAKE_MESSAGES = 32, FAKE_MESSAGE_BYTES = 1024 };

/// What one message of recvmmsg() holds, or the error it gives.
typedef struct fake_item_t {
    int error; ///< errno, 0 = a frame
    struct canfd_frame frame;
    unsigned bytes; ///< 16, 72, or what a kernel never gives
    uint32_t drops;
    int64_t sw_ns, hw_ns; ///< 0 = no stamp
    int old_stamp;        ///< SO_TIMESTAMP instead of SO_TIMESTAMPING
} fake_item_t;

static struct {
    // the interface
    const char* name;
    int index, type, up; ///< index 0 = there is none
    uint32_t meminfo_drops, bitrate, restart_ms, state;
    uint64_t rx_dropped, rx_over_errors;
    const char* kind;
    // what fails
    int socket_error, bind_error, netlink_error, no_stamps, no_force;
    int listen_error, flags_error, poll_set_error, poll_add_error; ///< bind() of netlink, SIOCGIFFLAGS, epoll_...
    int late_answers;                                              ///< EAGAIN so often before a question is answered
    int modprobes; ///< asked for an interface that is not there in the way that makes a kernel look for a module
    // sockets
    int can_fd, watch_fd, query_fd, can_sockets;
    int filters, buffer;
    struct can_filter filter[8];
    fake_item_t items[FAKE_QUEUE];
    int first, last;
    char messages[FAKE_MESSAGES][FAKE_MESSAGE_BYTES];
    int lengths[FAKE_MESSAGES], message_first, message_last; ///< length < 0: -errno
    int asked;
} fake;

static void fake_reset(void) {
    memset(&fake, 0, sizeof fake);
    fake.name = "can0";
    fake.kind = "can";
    fake.index = 5;
    fake.type = ARPHRD_CAN;
    fake.up = 1;
    fake.bitrate = 500000;
    fake.can_fd = fake.watch_fd = fake.query_fd = -1;
}

static void fake_ready(int fd) {
    const uint64_t one = 1;
    if (fd >= 0) (void)!write(fd, &one, sizeof one);
}

static void fake_quiet(int fd) {
    uint64_t count;
    if (fd >= 0) (void)!read(fd, &count, sizeof count);
}

static inline void fake_put(fake_item_t item) {
    fake.items[fake.last++ % FAKE_QUEUE] = item;
    fake_ready(fake.can_fd);
}

static inline void fake_fail(int error) {
    fake_item_t item;
    memset(&item, 0, sizeof item);
    item.error = error;
    fake_put(item);
}

static void fake_attribute(char* message, size_t* used, int type, const void* value, size_t bytes) {
    struct rtattr head = {(unsigned short)RTA_LENGTH(bytes), (unsigned short)type};
    memcpy(message + *used, &head, sizeof head);
    memcpy(message + *used + RTA_LENGTH(0), value, bytes);
    *used += RTA_SPACE(bytes);
}

/// Write an RTM_NEWLINK or RTM_DELLINK message of the interface. @return its bytes
static size_t fake_link_message(char* message, int type) {
    memset(message, 0, FAKE_MESSAGE_BYTES);
    struct nlmsghdr header = {0, (unsigned short)type, 0, 0, 0};
    struct ifinfomsg info;
    memset(&info, 0, sizeof info);
    info.ifi_index = fake.index;
    info.ifi_type = (unsigned short)fake.type;
    info.ifi_flags = fake.up ? IFF_UP | IFF_RUNNING : 0;
    size_t used = NLMSG_SPACE(sizeof info);
    const uint32_t mtu = 72, queue = 10;
    fake_attribute(message, &used, IFLA_IFNAME, fake.name, strlen(fake.name) + 1);
    fake_attribute(message, &used, IFLA_MTU, &mtu, sizeof mtu);
    fake_attribute(message, &used, IFLA_TXQLEN, &queue, sizeof queue);
    struct rtnl_link_stats64 counts;
    memset(&counts, 0, sizeof counts);
    counts.rx_dropped = fake.rx_dropped;
    counts.rx_over_errors = fake.rx_over_errors;
    fake_attribute(message, &used, IFLA_STATS64, &counts, sizeof counts);

    char inner[512], data[256];
    size_t inner_used = 0, data_used = 0;
    memset(inner, 0, sizeof inner);
    memset(data, 0, sizeof data);
    struct can_bittiming timing;
    memset(&timing, 0, sizeof timing);
    timing.bitrate = fake.bitrate;
    const struct can_berr_counter errors = {12, 34};
    const struct can_ctrlmode mode = {CAN_CTRLMODE_LISTENONLY, CAN_CTRLMODE_LISTENONLY};
    fake_attribute(data, &data_used, IFLA_CAN_STATE, &fake.state, sizeof fake.state);
    fake_attribute(data, &data_used, IFLA_CAN_RESTART_MS, &fake.restart_ms, sizeof fake.restart_ms);
    fake_attribute(data, &data_used, IFLA_CAN_BITTIMING, &timing, sizeof timing);
    timing.bitrate *= 4;
    fake_attribute(data, &data_used, IFLA_CAN_DATA_BITTIMING, &timing, sizeof timing);
    fake_attribute(data, &data_used, IFLA_CAN_BERR_COUNTER, &errors, sizeof errors);
    fake_attribute(data, &data_used, IFLA_CAN_CTRLMODE, &mode, sizeof mode);
    const struct can_device_stats device = {1, 2, 3, 4, 5, 6};
    fake_attribute(inner, &inner_used, IFLA_INFO_KIND, fake.kind, strlen(fake.kind) + 1);
    fake_attribute(inner, &inner_used, IFLA_INFO_DATA, data, data_used);
    fake_attribute(inner, &inner_used, IFLA_INFO_XSTATS, &device, sizeof device);
    fake_attribute(message, &used, IFLA_LINKINFO, inner, inner_used);
    header.nlmsg_len = (uint32_t)used;
    memcpy(message, &header, sizeof header);
    memcpy(message + NLMSG_HDRLEN, &info, sizeof info);
    return used;
}

/// The interface changed: tell whoever watches.
static void fake_tell(int type) {
    fake.lengths[fake.message_last % FAKE_MESSAGES] =
        (int)fake_link_message(fake.messages[fake.message_last % FAKE_MESSAGES], type);
    ++fake.message_last;
    fake_ready(fake.watch_fd);
}

static inline void fake_tell_error(int error) {
    fake.lengths[fake.message_last++ % FAKE_MESSAGES] = -error;
    fake_ready(fake.watch_fd);
}

static int fake_fault(int error) {
    errno = error;
    return -1;
}

int socket(int domain, int type, int protocol) {
    (void)type;
    (void)protocol;
    if (domain == AF_NETLINK && fake.netlink_error) return fake_fault(fake.netlink_error);
    if (domain != AF_NETLINK && fake.socket_error) return fake_fault(fake.socket_error);
    int fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (domain == AF_NETLINK)
        fake.query_fd = fd;
    else
        fake.can_fd = fd, ++fake.can_sockets;
    return fd;
}

int bind(int fd, const struct sockaddr* address, socklen_t length) {
    (void)length;
    if (address->sa_family != AF_NETLINK) return fake.bind_error ? fake_fault(fake.bind_error) : 0;
    if (fake.listen_error) return fake_fault(fake.listen_error);
    struct sockaddr_nl netlink;
    memcpy(&netlink, address, sizeof netlink);
    if (netlink.nl_groups)
        fake.watch_fd = fd;
    else if (fake.watch_fd == fd) // that one was closed, and its number is used again
        fake.watch_fd = -1;
    return 0;
}

int setsockopt(int fd, int level, int name, const void* value, socklen_t length) {
    (void)fd;
    if (level == SOL_SOCKET && name == SO_TIMESTAMPING && fake.no_stamps >= 1) return fake_fault(ENOPROTOOPT);
    if (level == SOL_SOCKET && name == SO_TIMESTAMP && fake.no_stamps >= 2) return fake_fault(ENOPROTOOPT);
    if (level == SOL_SOCKET && name == SO_RCVBUFFORCE && fake.no_force) return fake_fault(EPERM);
    if (level == SOL_SOCKET && (name == SO_RCVBUF || name == SO_RCVBUFFORCE)) {
        memcpy(&fake.buffer, value, sizeof fake.buffer);
        if (name == SO_RCVBUF && fake.buffer > 212992) fake.buffer = 212992;
    }
    if (level == SOL_CAN_RAW && name == CAN_RAW_FILTER) {
        fake.filters = (int)(length / sizeof fake.filter[0]);
        memcpy(fake.filter, value, length < sizeof fake.filter ? length : sizeof fake.filter);
    }
    return 0;
}

int getsockopt(int fd, int level, int name, void* restrict value, socklen_t* restrict length) {
    (void)fd;
    (void)level;
    if (name == SO_RCVBUF) {
        const int doubled = 2 * fake.buffer;
        memcpy(value, &doubled, sizeof doubled);
    }
    if (name == SO_MEMINFO) {
        uint32_t info[SK_MEMINFO_VARS] = {0};
        info[SK_MEMINFO_DROPS] = fake.meminfo_drops;
        memcpy(value, info, *length);
    }
    return 0;
}

int ioctl(int fd, unsigned long request, ...) {
    (void)fd;
    va_list list;
    va_start(list, request);
    struct ifreq* about = va_arg(list, struct ifreq*);
    va_end(list);
    if (!fake.index || strcmp(about->ifr_name, fake.name) != 0) {
        ++fake.modprobes;
        return fake_fault(ENODEV);
    }
    if (request == SIOCGIFFLAGS && fake.flags_error) return fake_fault(fake.flags_error);
    if (request == SIOCGIFHWADDR) about->ifr_hwaddr.sa_family = (sa_family_t)fake.type;
    if (request == SIOCGIFFLAGS) about->ifr_flags = fake.up ? IFF_UP : 0;
    if (request == SIOCGIFINDEX) about->ifr_ifindex = fake.index;
    return 0;
}

int epoll_create1(int flags) {
    return fake.poll_set_error ? fake_fault(fake.poll_set_error) : (int)syscall(SYS_epoll_create1, flags);
}

int epoll_ctl(int set, int what, int fd, struct epoll_event* event) {
    return fake.poll_add_error ? fake_fault(fake.poll_add_error) : (int)syscall(SYS_epoll_ctl, set, what, fd, event);
}

static void fake_control(struct msghdr* header, int type, const void* value, size_t bytes) {
    struct cmsghdr part;
    memset(&part, 0, sizeof part);
    part.cmsg_len = CMSG_LEN(bytes);
    part.cmsg_level = SOL_SOCKET;
    part.cmsg_type = type;
    char* to = (char*)header->msg_control + header->msg_controllen;
    memcpy(to, &part, sizeof part);
    memcpy(to + CMSG_LEN(0), value, bytes);
    header->msg_controllen += CMSG_SPACE(bytes);
}

static void fake_fill(struct mmsghdr* message, const fake_item_t* item) {
    struct msghdr* header = &message->msg_hdr;
    memset(header->msg_control, 0, header->msg_controllen);
    header->msg_controllen = 0;
    const size_t room = header->msg_iov->iov_len, bytes = item->bytes < room ? item->bytes : room;
    memcpy(header->msg_iov->iov_base, &item->frame, bytes);
    message->msg_len = (unsigned)bytes;
    fake_control(header, SO_RXQ_OVFL, &item->drops, sizeof item->drops);
    if (item->old_stamp) {
        const struct timeval stamp = {item->sw_ns / 1000000000, item->sw_ns / 1000 % 1000000};
        fake_control(header, SCM_TIMESTAMP, &stamp, sizeof stamp);
    } else if (item->sw_ns || item->hw_ns) {
        struct scm_timestamping stamps;
        memset(&stamps, 0, sizeof stamps);
        stamps.ts[0].tv_sec = item->sw_ns / 1000000000;
        stamps.ts[0].tv_nsec = item->sw_ns % 1000000000;
        stamps.ts[2].tv_sec = item->hw_ns / 1000000000;
        stamps.ts[2].tv_nsec = item->hw_ns % 1000000000;
        fake_control(header, SCM_TIMESTAMPING, &stamps, sizeof stamps);
    }
}

int recvmmsg(int fd, struct mmsghdr* messages, unsigned count, int flags, struct timespec* timeout) {
    (void)flags;
    (void)timeout;
    if (fd != fake.can_fd) return fake_fault(EAGAIN); // the socket of a device that is gone stays silent
    unsigned got = 0;
    while (got < count && fake.first < fake.last && !fake.items[fake.first % FAKE_QUEUE].error)
        fake_fill(&messages[got++], &fake.items[fake.first++ % FAKE_QUEUE]);
    const int error = fake.first < fake.last ? fake.items[fake.first % FAKE_QUEUE].error : EAGAIN;
    if (!got && fake.first < fake.last) ++fake.first;
    if (fake.first == fake.last) fake_quiet(fd);
    return got ? (int)got : fake_fault(error);
}

ssize_t send(int fd, const void* request, size_t bytes, int flags) {
    (void)flags;
    (void)request;
    if (fake.asked == -1) return fake_fault(EPERM);
    ++fake.asked;
    fake_ready(fd);
    return (ssize_t)bytes;
}

ssize_t recv(int fd, void* buffer, size_t bytes, int flags) {
    (void)bytes;
    (void)flags;
    if (fd != fake.watch_fd && fake.late_answers-- > 0) return fake_fault(EAGAIN);
    if (fd != fake.watch_fd) { // the answer to a question
        if (fake.index) return (ssize_t)fake_link_message(buffer, RTM_NEWLINK);
        struct {
            struct nlmsghdr header;
            struct nlmsgerr error;
        } refusal;
        memset(&refusal, 0, sizeof refusal);
        refusal.header.nlmsg_type = NLMSG_ERROR;
        refusal.header.nlmsg_len = sizeof refusal;
        refusal.error.error = -ENODEV;
        memcpy(buffer, &refusal, sizeof refusal);
        return sizeof refusal;
    }
    if (fake.message_first == fake.message_last) {
        fake_quiet(fd);
        return fake_fault(EAGAIN);
    }
    const int at = fake.message_first++ % FAKE_MESSAGES;
    if (fake.lengths[at] < 0) return fake_fault(-fake.lengths[at]);
    memcpy(buffer, fake.messages[at], (size_t)fake.lengths[at]);
    return fake.lengths[at];
}

#endif
