// SPDX-License-Identifier: MIT
// PURPOSE  state of an interface and of its CAN controller, and word of every change
// METHOD   rtnetlink: RTM_GETLINK by name for one answer, membership of RTNLGRP_LINK for changes; attributes are walked with
//          every length checked, fields that a driver leaves out stay 0
#include <drv/link.h>

#include <errno.h>

#include <linux/can/netlink.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { MESSAGE_BYTES = 8192, ANSWER_MS = 200 };

const char* drv_bus_state_name(drv_bus_state_t state) {
    static const char* const names[] = {"unknown", "error-active", "error-warning", "error-passive",
                                        "bus-off", "stopped",      "sleeping"};
    return names[(unsigned)state < sizeof names / sizeof names[0] ? state : DRV_BUS_UNKNOWN];
}

typedef struct parts_t {
    const char* at;
    size_t left;
} parts_t;

static parts_t parts_of(const struct rtattr* whole) {
    parts_t out = {(const char*)RTA_DATA(whole), RTA_PAYLOAD(whole)};
    return out;
}

/// The next attribute, NULL at the end or where the rest does not hold together.
static const struct rtattr* next_part(parts_t* self) {
    const struct rtattr* part = (const struct rtattr*)self->at;
    if (self->left < sizeof *part || part->rta_len < sizeof *part || part->rta_len > self->left) return NULL;
    size_t step = RTA_ALIGN((size_t)part->rta_len);
    if (step > self->left) step = self->left;
    self->at += step;
    self->left -= step;
    return part;
}

/// Copy a fixed-size value out of an attribute. @return 1, or 0 when it is too short
static int take(const struct rtattr* part, void* to, size_t bytes) {
    if (RTA_PAYLOAD(part) < bytes) return 0;
    memcpy(to, RTA_DATA(part), bytes);
    return 1;
}

static void take_text(const struct rtattr* part, char* to, size_t capacity) {
    size_t length = RTA_PAYLOAD(part);
    if (length > capacity - 1) length = capacity - 1;
    memcpy(to, RTA_DATA(part), length);
    to[length] = '\0';
}

static drv_bus_state_t state_of(uint32_t kernel) {
    static const drv_bus_state_t states[] = {DRV_BUS_ACTIVE, DRV_BUS_WARNING, DRV_BUS_PASSIVE,
                                             DRV_BUS_OFF,    DRV_BUS_STOPPED, DRV_BUS_SLEEPING};
    return kernel < sizeof states / sizeof states[0] ? states[kernel] : DRV_BUS_UNKNOWN;
}

static void parse_can(const struct rtattr* data, drv_link_t* out) {
    parts_t parts = parts_of(data);
    for (const struct rtattr* part; (part = next_part(&parts));) {
        uint32_t value = 0;
        struct can_bittiming timing;
        struct can_berr_counter counter;
        struct can_ctrlmode mode;
        switch (part->rta_type) {
        case IFLA_CAN_STATE:
            if (take(part, &value, sizeof value)) out->state = state_of(value);
            break;
        case IFLA_CAN_RESTART_MS: (void)take(part, &out->restart_ms, sizeof out->restart_ms); break;
        case IFLA_CAN_BITTIMING:
            if (take(part, &timing, sizeof timing)) out->bitrate = timing.bitrate;
            break;
        case IFLA_CAN_DATA_BITTIMING:
            if (take(part, &timing, sizeof timing)) out->dbitrate = timing.bitrate;
            break;
        case IFLA_CAN_BERR_COUNTER:
            if (!take(part, &counter, sizeof counter)) break;
            out->has_error_counters = 1;
            out->tx_errors = counter.txerr;
            out->rx_errors = counter.rxerr;
            break;
        case IFLA_CAN_CTRLMODE:
            if (take(part, &mode, sizeof mode)) out->listen_only = (mode.flags & CAN_CTRLMODE_LISTENONLY) != 0;
            break;
        default: break;
        }
    }
}

static void parse_info(const struct rtattr* info, drv_link_t* out) {
    const struct rtattr *data = NULL, *statistics = NULL;
    parts_t parts = parts_of(info);
    for (const struct rtattr* part; (part = next_part(&parts));) {
        if (part->rta_type == IFLA_INFO_KIND) take_text(part, out->kind, sizeof out->kind);
        if (part->rta_type == IFLA_INFO_DATA) data = part;
        if (part->rta_type == IFLA_INFO_XSTATS) statistics = part;
    }
    if (strcmp(out->kind, "can") != 0) return; // other kinds have other attributes under the same numbers
    struct can_device_stats counts;
    if (data) {
        out->has_can_data = 1;
        parse_can(data, out);
    }
    if (statistics && take(statistics, &counts, sizeof counts)) {
        out->bus_off_count = counts.bus_off;
        out->restart_count = counts.restarts;
    }
}

int drv_link_parse(const void* message, size_t bytes, drv_link_t* out) {
    struct nlmsghdr header;
    struct ifinfomsg info;
    const size_t fixed = NLMSG_SPACE(sizeof info);
    if (bytes < fixed) return -1;
    memcpy(&header, message, sizeof header);
    if (header.nlmsg_len < fixed || header.nlmsg_len > bytes) return -1;
    if (header.nlmsg_type != RTM_NEWLINK && header.nlmsg_type != RTM_DELLINK) return -1;
    memcpy(&info, (const char*)message + NLMSG_HDRLEN, sizeof info);
    memset(out, 0, sizeof *out);
    out->index = info.ifi_index;
    out->is_can = info.ifi_type == ARPHRD_CAN;
    out->gone = header.nlmsg_type == RTM_DELLINK;
    out->up = !out->gone && (info.ifi_flags & IFF_UP);
    out->running = !out->gone && (info.ifi_flags & IFF_RUNNING);
    struct rtnl_link_stats64 counts;
    uint32_t value = 0;
    parts_t parts = {(const char*)message + fixed, header.nlmsg_len - fixed};
    for (const struct rtattr* part; (part = next_part(&parts));) {
        switch (part->rta_type) {
        case IFLA_IFNAME: take_text(part, out->name, sizeof out->name); break;
        case IFLA_MTU:
            if (take(part, &value, sizeof value)) out->mtu = (int32_t)value;
            break;
        case IFLA_TXQLEN: (void)take(part, &out->tx_queue, sizeof out->tx_queue); break;
        case IFLA_LINKINFO: parse_info(part, out); break;
        case IFLA_STATS64: // newer kernels append fields: the old ones stand first
            if (!take(part, &counts, offsetof(struct rtnl_link_stats64, rx_crc_errors))) break;
            out->rx_dropped = counts.rx_dropped;
            out->rx_over_errors = counts.rx_over_errors;
            break;
        default: break;
        }
    }
    return 0;
}

static int open_netlink(uint32_t groups) {
    int fd = socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, NETLINK_ROUTE);
    if (fd < 0) return -errno;
    struct sockaddr_nl address;
    memset(&address, 0, sizeof address);
    address.nl_family = AF_NETLINK;
    address.nl_groups = groups;
    if (bind(fd, (struct sockaddr*)&address, sizeof address) == 0) return fd;
    int code = errno;
    close(fd);
    return -code;
}

static int ask(int fd, const char* interface) {
    struct {
        struct nlmsghdr header;
        struct ifinfomsg info;
        struct rtattr name;
        char text[IFNAMSIZ];
    } request;
    size_t length = strlen(interface) + 1;
    if (length > sizeof request.text) return -ENODEV;
    memset(&request, 0, sizeof request);
    memcpy(request.text, interface, length);
    request.name.rta_type = IFLA_IFNAME;
    request.name.rta_len = (unsigned short)RTA_LENGTH(length);
    request.header.nlmsg_type = RTM_GETLINK;
    request.header.nlmsg_flags = NLM_F_REQUEST;
    request.header.nlmsg_len = (uint32_t)(NLMSG_SPACE(sizeof request.info) + RTA_LENGTH(length));
    ssize_t sent;
    do sent = send(fd, &request, request.header.nlmsg_len, 0);
    while (sent < 0 && errno == EINTR);
    return sent < 0 ? -errno : 0;
}

/// The kernel's answer to ask(). @return 0 or -errno
static int answer(int fd, drv_link_t* out) {
    _Alignas(struct nlmsghdr) char message[MESSAGE_BYTES];
    for (int tries = 0; tries < 4; ++tries) {
        ssize_t got = recv(fd, message, sizeof message, 0);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) {
            struct pollfd wait = {fd, POLLIN, 0};
            (void)poll(&wait, 1, ANSWER_MS);
            continue;
        }
        if (got < 0) return -errno;
        if (drv_link_parse(message, (size_t)got, out) == 0) return 0;
        struct nlmsghdr header;
        int code = 0;
        if ((size_t)got < NLMSG_SPACE(sizeof code)) return -EPROTO;
        memcpy(&header, message, sizeof header);
        memcpy(&code, message + NLMSG_HDRLEN, sizeof code);
        return header.nlmsg_type == NLMSG_ERROR && code < 0 ? code : -EPROTO;
    }
    return -ETIMEDOUT;
}

int drv_link_read(const char* interface, drv_link_t* out) {
    memset(out, 0, sizeof *out);
    int fd = open_netlink(0);
    if (fd < 0) return fd;
    int code = ask(fd, interface);
    if (code == 0) code = answer(fd, out);
    close(fd);
    return code;
}

int drv_link_watch(void) { return open_netlink(RTMGRP_LINK); }

int drv_link_changes(int fd, const char* interface, drv_link_t* out) {
    _Alignas(struct nlmsghdr) char message[MESSAGE_BYTES];
    int changed = 0;
    for (int messages = 0; messages < 256; ++messages) { // bounded: the rest wakes us again
        ssize_t got = recv(fd, message, sizeof message, MSG_DONTWAIT);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0 && errno == ENOBUFS) { // some were lost: whatever happened, look
            memset(out, 0, sizeof *out);
            changed = 1;
            continue;
        }
        if (got <= 0) break;
        const char* at = message;
        for (size_t left = (size_t)got; left >= NLMSG_HDRLEN;) {
            struct nlmsghdr header;
            memcpy(&header, at, sizeof header);
            if (header.nlmsg_len < NLMSG_HDRLEN || header.nlmsg_len > left) break;
            drv_link_t one;
            if (drv_link_parse(at, left, &one) == 0 && strcmp(one.name, interface) == 0) {
                *out = one;
                changed = 1;
            }
            size_t step = NLMSG_ALIGN(header.nlmsg_len);
            if (step > left) break;
            at += step;
            left -= step;
        }
    }
    return changed;
}
