// SPDX-License-Identifier: MIT
/// @file link.h
/// What the kernel tells of a network interface: is it there, is it up, and what its CAN controller is doing.
#ifndef DRV_LINK_H
#define DRV_LINK_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// State of a CAN controller by its error counters; unknown for virtual interfaces.
typedef enum drv_bus_state_t {
    DRV_BUS_UNKNOWN, ///< not known
    DRV_BUS_ACTIVE,  ///< all well
    DRV_BUS_WARNING, ///< an error counter is above 95
    DRV_BUS_PASSIVE, ///< above 127: it no longer marks errors of others
    DRV_BUS_OFF,     ///< above 255: it neither sends nor receives until it is restarted
    DRV_BUS_STOPPED, ///< switched off
    DRV_BUS_SLEEPING ///< in sleep mode
} drv_bus_state_t;

/// "error-active", "bus-off", … as `ip -details link` writes them. Static text.
const char* drv_bus_state_name(drv_bus_state_t state);

/// A network interface.
typedef struct drv_link_t {
    char name[16];              ///< "can0"
    char kind[16];              ///< "can", "vcan", "slcan", …, "" when the driver does not tell
    int32_t index;              ///< of the interface, 0 = there is none
    uint8_t is_can;             ///< 1 = a CAN interface, virtual ones included
    uint8_t up;                 ///< 1 = administratively up
    uint8_t running;            ///< 1 = can carry frames now (0 after bus-off)
    uint8_t gone;               ///< 1 = this message says that the interface was removed
    uint8_t has_can_data;       ///< 1 = the driver reported the fields from `state` on
    int32_t mtu;                ///< 16 classic, 72 FD
    uint32_t tx_queue;          ///< frames the send queue holds (txqueuelen)
    drv_bus_state_t state;      ///< of the controller
    uint8_t listen_only;        ///< 1 = sends nothing, not even acknowledgements
    uint8_t has_error_counters; ///< 1 = the driver reported the next two
    uint16_t tx_errors;         ///< error counter of the controller now
    uint16_t rx_errors;         ///< error counter of the controller now
    uint32_t bitrate;           ///< bit/s, 0 = not set
    uint32_t dbitrate;          ///< bit/s, 0 = not set
    uint32_t restart_ms;        ///< 0 = stays off after bus-off
    uint32_t bus_off_count;     ///< since the interface exists
    uint32_t restart_count;     ///< since the interface exists
    uint64_t rx_dropped;        ///< frames the driver dropped
    uint64_t rx_over_errors;    ///< times the controller's receive queue overran
} drv_link_t;

/// Where on USB an interface sits.
typedef struct drv_usb_t {
    char port[32];    ///< the port of its adapter as the kernel names it, "1-1.4"
    char serial[128]; ///< serial number of its adapter, "" = it has none
} drv_usb_t;

/// @param sysfs  "/sys"
/// @return 0, or -ENODEV when this interface is not one of USB
int drv_link_usb(const char* sysfs, const char* interface, drv_usb_t* out);

/// The CAN interface of a USB adapter, whatever its name is today.
/// @param sysfs    "/sys"
/// @param adapter  its serial number, or the port it is plugged into
/// @param channel  which of its interfaces, 0 first
/// @param name     out; untouched when there is none
/// @return 0, -ENODEV no such adapter or channel, -ENOTUNIQ several adapters have this serial number
int drv_link_find(const char* sysfs, const char* adapter, int32_t channel, char name[16]);

/// Ask the kernel for an interface. @return 0, -ENODEV when there is none, or another -errno
int drv_link_read(const char* interface, drv_link_t* out);

/// A socket that becomes readable whenever an interface of this machine comes, goes or changes. @return fd or -errno
int drv_link_watch(void);

/// Empty such a socket. @return 1 when it held news of the interface named (or lost messages), with its newest state in
/// `out` (out->index = 0 when that is not known: read it), else 0
int drv_link_changes(int fd, const char* interface, drv_link_t* out);

/// Take one rtnetlink message apart. @return 0, or -1 when it does not describe an interface
int drv_link_parse(const void* message, size_t bytes, drv_link_t* out);

#ifdef __cplusplus
}
#endif
#endif
