/* Plays the parts of Zephyr that mbm's port and sample use, with the signatures of Zephyr 3.7.
 * Licence: MIT OR Apache-2.0. */
#pragma once

#include <zephyr/device.h>

typedef struct {
    int64_t ticks;
} k_timeout_t;

struct k_sem {
    unsigned count, limit;
};

struct k_spinlock {
    bool isLocked;
};

typedef struct {
    int key;
} k_spinlock_key_t;

/* 10000 ticks a second, the default of most boards, and 64 MHz. */
enum { STAND_IN_TICK_US = 100, STAND_IN_MHZ = 64 };

#define MIN(a, b) ((a) < (b) ? (a) : (b))

#define K_TICKS(count) ((k_timeout_t){(int64_t)(count)})

int64_t k_uptime_ticks(void);
uint32_t k_uptime_get_32(void);
uint32_t k_cycle_get_32(void);
uint32_t k_us_to_cyc_ceil32(uint32_t micros);
uint32_t k_us_to_ticks_floor32(uint32_t micros);
uint64_t k_ticks_to_us_floor64(uint64_t ticks);
int32_t k_msleep(int32_t milliseconds);

k_spinlock_key_t k_spin_lock(struct k_spinlock *lock);
void k_spin_unlock(struct k_spinlock *lock, k_spinlock_key_t key);

int k_sem_init(struct k_sem *sem, unsigned count, unsigned limit);
void k_sem_give(struct k_sem *sem);
int k_sem_take(struct k_sem *sem, k_timeout_t timeout);
