// SPDX-License-Identifier: MIT
// PURPOSE  which CAN interface a USB adapter has today, by its serial number or by the port it is plugged into
// METHOD   /sys/class/net/NAME/device leads to the USB interface its driver serves; above that stands the device, the first
//          folder with idVendor: its name is the port. Interfaces of one adapter are numbered as its driver made them.
#include <drv/link.h>

#include <dirent.h>
#include <errno.h>
#include <limits.h>
#include <net/if_arp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_CHANNELS = 32, INTERFACE_BYTES = 16 };

/// First line of FOLDER/NAME. @return 1 when there is such a file
static int read_text(const char* folder, const char* name, char* to, int capacity) {
    char path[2 * PATH_MAX];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE* file = fopen(path, "re");
    to[0] = '\0';
    if (!file) return 0;
    if (fgets(to, capacity, file)) to[strcspn(to, "\n")] = '\0';
    fclose(file);
    return 1;
}

int drv_link_usb(const char* sysfs, const char* interface, drv_usb_t* out) {
    char path[PATH_MAX], folder[PATH_MAX], text[16];
    memset(out, 0, sizeof *out);
    snprintf(path, sizeof path, "%s/class/net/%s/device", sysfs, interface);
    if (!realpath(path, folder)) return -ENODEV;
    for (char* slash = strrchr(folder, '/'); slash && slash != folder; slash = strrchr(folder, '/')) {
        if (read_text(folder, "idVendor", text, sizeof text)) {
            if (strlen(slash + 1) >= sizeof out->port) return -ENODEV;
            memcpy(out->port, slash + 1, strlen(slash + 1));
            (void)read_text(folder, "serial", out->serial, sizeof out->serial);
            return 0;
        }
        *slash = '\0';
    }
    return -ENODEV;
}

typedef struct channel_t {
    long index; ///< of the interface
    char name[INTERFACE_BYTES];
} channel_t;

static int by_index(const void* a, const void* b) {
    const channel_t *one = a, *other = b;
    return (one->index > other->index) - (one->index < other->index);
}

/// Is it a CAN interface, and with which index?
static int look(const char* sysfs, const char* name, channel_t* out) {
    char folder[PATH_MAX], text[16];
    const size_t length = strlen(name);
    if (name[0] == '.' || length >= sizeof out->name) return 0;
    snprintf(folder, sizeof folder, "%s/class/net/%s", sysfs, name);
    if (!read_text(folder, "type", text, sizeof text) || strtol(text, NULL, 10) != ARPHRD_CAN) return 0;
    if (!read_text(folder, "ifindex", text, sizeof text)) return 0;
    memset(out, 0, sizeof *out);
    memcpy(out->name, name, length);
    out->index = strtol(text, NULL, 10);
    return 1;
}

int drv_link_find(const char* sysfs, const char* adapter, int32_t channel, char name[16]) {
    char folder[PATH_MAX], port[sizeof(((drv_usb_t*)0)->port)] = "";
    snprintf(folder, sizeof folder, "%s/class/net", sysfs);
    DIR* all = opendir(folder);
    if (!all) return -ENODEV;
    channel_t found[MOST_CHANNELS];
    int count = 0, code = 0;
    for (const struct dirent* entry; code == 0 && count < MOST_CHANNELS && (entry = readdir(all));) {
        drv_usb_t usb;
        if (!look(sysfs, entry->d_name, &found[count]) || drv_link_usb(sysfs, entry->d_name, &usb) != 0) continue;
        if ((usb.serial[0] == '\0' || strcmp(usb.serial, adapter) != 0) && strcmp(usb.port, adapter) != 0) continue;
        if (count > 0 && strcmp(port, usb.port) != 0) code = -ENOTUNIQ;
        memcpy(port, usb.port, sizeof port);
        ++count;
    }
    closedir(all);
    if (code) return code;
    if (channel < 0 || channel >= count) return -ENODEV;
    qsort(found, (size_t)count, sizeof found[0], by_index);
    memcpy(name, found[channel].name, sizeof found[channel].name);
    return 0;
}
