// SPDX-License-Identifier: MIT
// PURPOSE  what the controller's error messages say: classes counted, one sentence
// METHOD   class bits of the identifier and detail bytes as in linux/can/error.h, one table a class
#include <drv/can_error.h>

#include <stdio.h>
#include <string.h>

#include <linux/can/error.h>

#ifndef CAN_ERR_CNT // named since Linux 6.0
#define CAN_ERR_CNT 0x00000200U
#endif

typedef struct named_bit_t {
    uint32_t bit;
    const char* name;
} named_bit_t;

static const named_bit_t controller[] = {{CAN_ERR_CRTL_RX_OVERFLOW, "receive queue overran"},
                                         {CAN_ERR_CRTL_TX_OVERFLOW, "send queue overran"},
                                         {CAN_ERR_CRTL_RX_WARNING, "receive error counter above 95"},
                                         {CAN_ERR_CRTL_TX_WARNING, "send error counter above 95"},
                                         {CAN_ERR_CRTL_RX_PASSIVE, "error-passive by receive errors"},
                                         {CAN_ERR_CRTL_TX_PASSIVE, "error-passive by send errors"},
                                         {CAN_ERR_CRTL_ACTIVE, "error-active again"}};
static const named_bit_t protocol[] = {{CAN_ERR_PROT_BIT, "bit error"},
                                       {CAN_ERR_PROT_FORM, "form error"},
                                       {CAN_ERR_PROT_STUFF, "stuff error"},
                                       {CAN_ERR_PROT_BIT0, "no dominant bit could be sent"},
                                       {CAN_ERR_PROT_BIT1, "a recessive bit was read dominant"},
                                       {CAN_ERR_PROT_OVERLOAD, "overload"},
                                       {CAN_ERR_PROT_ACTIVE, "active error"},
                                       {CAN_ERR_PROT_TX, "while sending"}};
static const named_bit_t classes[] = {{CAN_ERR_BUSOFF, "bus-off"},
                                      {CAN_ERR_RESTARTED, "restarted after bus-off"},
                                      {CAN_ERR_ACK, "no acknowledgement: is another node on the bus?"},
                                      {CAN_ERR_TX_TIMEOUT, "sending timed out"},
                                      {CAN_ERR_LOSTARB, "arbitration lost"},
                                      {CAN_ERR_TRX, "transceiver or wiring fault"}};

typedef struct writer_t {
    char* out;
    size_t used, capacity;
} writer_t;

static void append(writer_t* to, const char* text) {
    if (to->capacity == 0) return;
    size_t room = to->capacity - 1 - to->used, length = strlen(text);
    if (length > room) length = room;
    memcpy(to->out + to->used, text, length);
    to->used += length;
    to->out[to->used] = '\0';
}

static void append_bits(writer_t* to, uint32_t bits, const named_bit_t* table, size_t count) {
    for (size_t i = 0; i < count; ++i) {
        if (!(bits & table[i].bit)) continue;
        if (to->used) append(to, "; ");
        append(to, table[i].name);
    }
}

void drv_can_error_text(uint32_t id, const uint8_t* data, char* out, size_t capacity) {
    writer_t to = {out, 0, capacity};
    if (capacity) out[0] = '\0';
    append_bits(&to, id, classes, sizeof classes / sizeof classes[0]);
    if (id & CAN_ERR_CRTL) append_bits(&to, data[1], controller, sizeof controller / sizeof controller[0]);
    if (id & CAN_ERR_PROT) append_bits(&to, data[2], protocol, sizeof protocol / sizeof protocol[0]);
    if (to.used == 0) append(&to, id & CAN_ERR_BUSERROR ? "bus error" : "error without a class");
    if (!(id & CAN_ERR_CNT) && data[6] == 0 && data[7] == 0) return; // older drivers fill them without the class bit
    char counters[48];
    snprintf(counters, sizeof counters, " (tx errors %u, rx errors %u)", data[6], data[7]);
    append(&to, counters);
}

void drv_can_error_count(drv_stats_t* counts, uint32_t id, const uint8_t* data) {
    ++counts->error_frames;
    counts->bus_off += (id & CAN_ERR_BUSOFF) != 0;
    counts->restarts += (id & CAN_ERR_RESTARTED) != 0;
    counts->no_ack += (id & CAN_ERR_ACK) != 0;
    counts->tx_timeouts += (id & CAN_ERR_TX_TIMEOUT) != 0;
    counts->bus_errors += (id & (CAN_ERR_PROT | CAN_ERR_BUSERROR)) != 0;
    if (id & CAN_ERR_CRTL) {
        counts->rx_overflows += (data[1] & CAN_ERR_CRTL_RX_OVERFLOW) != 0;
        counts->error_passive += (data[1] & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0;
    }
    if (id & CAN_ERR_BUSOFF)
        counts->state = DRV_BUS_OFF;
    else if ((id & CAN_ERR_CRTL) && (data[1] & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)))
        counts->state = DRV_BUS_PASSIVE;
    else if ((id & CAN_ERR_CRTL) && (data[1] & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)))
        counts->state = DRV_BUS_WARNING;
    else if ((id & CAN_ERR_RESTARTED) || ((id & CAN_ERR_CRTL) && (data[1] & CAN_ERR_CRTL_ACTIVE)))
        counts->state = DRV_BUS_ACTIVE;
    drv_can_error_text(id, data, counts->last_error, sizeof counts->last_error);
}
