// SPDX-License-Identifier: MIT
// PURPOSE  STM32F405 (Cortex-M4F): USART1 on PA9 and PA10 at 921600 baud, TIM2 as counter
// METHOD   the clock stays the internal oscillator of 16 MHz: a real board sets its PLL here. Registers: reference manual
//          RM0090, chapters 7 (RCC), 8 (GPIO), 18 (TIM2), 30 (USART)
#include "board.h"

#define REGISTER(address) (*(volatile uint32_t*)(address))
#define RCC_AHB1ENR REGISTER(0x40023830)
#define RCC_APB1ENR REGISTER(0x40023840)
#define RCC_APB2ENR REGISTER(0x40023844)
#define GPIOA_MODER REGISTER(0x40020000)
#define GPIOA_AFRH REGISTER(0x40020024)
#define USART1_SR REGISTER(0x40011000)
#define USART1_DR REGISTER(0x40011004)
#define USART1_BRR REGISTER(0x40011008)
#define USART1_CR1 REGISTER(0x4001100C)
#define TIM2_CR1 REGISTER(0x40000000)
#define TIM2_EGR REGISTER(0x40000014)
#define TIM2_CNT REGISTER(0x40000024)
#define TIM2_ARR REGISTER(0x4000002C)

enum { RECEIVED = 1 << 5, EMPTY = 1 << 7, ENABLE = 1 << 13 | 1 << 3 | 1 << 2, CLOCK_HZ = 16000000, BAUD = 921600 };

void board_start(void) {
    RCC_AHB1ENR |= 1; // GPIOA
    RCC_APB1ENR |= 1; // TIM2
    RCC_APB2ENR |= 1 << 4;
    GPIOA_AFRH = (GPIOA_AFRH & ~0xFF0u) | 0x770;
    GPIOA_MODER = (GPIOA_MODER & ~(0xFu << 18)) | 0xAu << 18;
    USART1_BRR = CLOCK_HZ / BAUD;
    USART1_CR1 = ENABLE;
    TIM2_ARR = 0xFFFFFFFF;
    TIM2_EGR = 1;
    TIM2_CR1 = 1;
}

uint8_t board_read(void) {
    while (!(USART1_SR & RECEIVED)) {
    }
    return (uint8_t)USART1_DR;
}

void board_write(uint8_t byte) {
    while (!(USART1_SR & EMPTY)) {
    }
    USART1_DR = byte;
}

uint32_t board_ticks(void) { return TIM2_CNT; }

#ifdef NODE_IN_QEMU // its TIM2 counts nanoseconds, whatever the clock tree says
uint32_t board_tick_hz(void) { return 1000000000; }
#else
uint32_t board_tick_hz(void) { return CLOCK_HZ; }
#endif
