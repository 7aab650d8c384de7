// SPDX-License-Identifier: MIT
// A simulated GPIO chip (gpio-sim in configfs) for C tests: 8 lines, line 2 named BUTTON, line 5 named LAMP.
#ifndef OKID_GPIO_SIM_H
#define OKID_GPIO_SIM_H

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#define SIM_FOLDER "/sys/kernel/config/gpio-sim/okid_unit"

typedef struct gpio_sim_t {
    char chip[64];     // "gpiochip0"
    char device[64];   // "gpio-sim.0"
    char folder[1024]; // of its lines in sysfs
} gpio_sim_t;

static int sim_write(const char* path, const char* text) {
    FILE* file = fopen(path, "w");
    if (!file) return -1;
    int bad = fputs(text, file) < 0;
    return fclose(file) != 0 || bad ? -1 : 0;
}

static int sim_read(const char* path, char* text, int bytes) {
    FILE* file = fopen(path, "r");
    if (!file) return -1;
    char* got = fgets(text, bytes, file);
    fclose(file);
    if (!got) return -1;
    text[strcspn(text, "\n")] = '\0';
    return 0;
}

static void sim_remove(void) {
    (void)sim_write(SIM_FOLDER "/live", "0");
    (void)rmdir(SIM_FOLDER "/bank0/line2");
    (void)rmdir(SIM_FOLDER "/bank0/line5");
    (void)rmdir(SIM_FOLDER "/bank0");
    (void)rmdir(SIM_FOLDER);
}

static int sim_make(gpio_sim_t* sim) {
    int bad = mkdir(SIM_FOLDER, 0755) | mkdir(SIM_FOLDER "/bank0", 0755) | mkdir(SIM_FOLDER "/bank0/line2", 0755) |
              mkdir(SIM_FOLDER "/bank0/line5", 0755);
    bad |= sim_write(SIM_FOLDER "/bank0/num_lines", "8") | sim_write(SIM_FOLDER "/bank0/label", "okid-sim");
    bad |= sim_write(SIM_FOLDER "/bank0/line2/name", "BUTTON") | sim_write(SIM_FOLDER "/bank0/line5/name", "LAMP");
    bad |= sim_write(SIM_FOLDER "/live", "1");
    bad |= sim_read(SIM_FOLDER "/bank0/chip_name", sim->chip, sizeof sim->chip);
    bad |= sim_read(SIM_FOLDER "/dev_name", sim->device, sizeof sim->device);
    snprintf(sim->folder, sizeof sim->folder, "/sys/devices/platform/%s/%s", sim->device, sim->chip);
    return bad;
}

/// What the world outside does to an input.
static int sim_pull(const gpio_sim_t* sim, int line, int up) {
    char path[1200];
    snprintf(path, sizeof path, "%s/sim_gpio%d/pull", sim->folder, line);
    return sim_write(path, up ? "pull-up" : "pull-down");
}

/// The voltage at a line, 0 or 1.
static int sim_value(const gpio_sim_t* sim, int line) {
    char path[1200], text[16];
    snprintf(path, sizeof path, "%s/sim_gpio%d/value", sim->folder, line);
    return sim_read(path, text, sizeof text) ? -1 : text[0] == '1';
}

static void sim_pause(int milliseconds) {
    struct timespec span = {milliseconds / 1000, milliseconds % 1000 * 1000000L};
    nanosleep(&span, NULL);
}

#endif
