#define _GNU_SOURCE
#include "freertos.h"

#include <assert.h>
#include <pthread.h>
#include <sched.h>
#include <time.h>

enum { NOTIFICATIONS = configTASK_NOTIFICATION_ARRAY_ENTRIES, START = 0xFF00 };

struct freertos_task {
    uint32_t value[NOTIFICATIONS];
};

unsigned freertos_sleeps, freertos_yields, freertos_given;
void (*freertos_before_check)(void), (*freertos_before_sleep)(void);

static pthread_mutex_t lock = PTHREAD_RECURSIVE_MUTEX_INITIALIZER_NP;
static pthread_cond_t changed = PTHREAD_COND_INITIALIZER;
static _Thread_local struct freertos_task self;

static struct timespec now(void)
{
    struct timespec at;

    clock_gettime(CLOCK_REALTIME, &at);
    return at;
}

/* Waits for a change, with the lock, until a time. Returns 0 once it is over. */
static int sleep_until(const struct timespec *end, TickType_t ticks)
{
    if (ticks > FREERTOS_LONGEST)
        return pthread_cond_wait(&changed, &lock) == 0;
    return pthread_cond_timedwait(&changed, &lock, end) == 0;
}

static struct timespec after(TickType_t ticks)
{
    struct timespec end = now();
    const long nanoseconds = end.tv_nsec + ticks % 1000 * 1000000L;

    end.tv_sec += ticks / 1000 + nanoseconds / 1000000000;
    end.tv_nsec = nanoseconds % 1000000000;
    return end;
}

static void once(void (**moment)(void))
{
    void (*call)(void) = *moment;

    *moment = NULL;
    if (call)
        call();
}

void freertos_enter(void)
{
    pthread_mutex_lock(&lock);
}

void freertos_exit(void)
{
    pthread_mutex_unlock(&lock);
}

void freertos_yield(void)
{
    freertos_yields++;
    sched_yield();
}

TaskHandle_t xTaskGetCurrentTaskHandle(void)
{
    once(&freertos_before_check);
    return &self;
}

TickType_t xTaskGetTickCount(void)
{
    static struct timespec first;
    struct timespec at;

    pthread_mutex_lock(&lock);
    at = now();
    if (first.tv_sec == 0)
        first = at;
    pthread_mutex_unlock(&lock);
    return (TickType_t)(START + (at.tv_sec - first.tv_sec) * 1000 +
                        (at.tv_nsec - first.tv_nsec) / 1000000);
}

uint32_t(ulTaskNotifyTakeIndexed)(UBaseType_t index, BaseType_t clear, TickType_t ticks)
{
    const struct timespec end = after(ticks);
    uint32_t value;

    once(&freertos_before_sleep);
    pthread_mutex_lock(&lock);
    freertos_sleeps++;
    while (self.value[index] == 0 && sleep_until(&end, ticks))
        ;
    value = self.value[index];
    self.value[index] = clear || value == 0 ? 0 : value - 1;
    pthread_mutex_unlock(&lock);
    return value;
}

BaseType_t xTaskNotifyGiveIndexed(TaskHandle_t task, UBaseType_t index)
{
    vTaskNotifyGiveIndexedFromISR(task, index, NULL);
    return pdTRUE;
}

void vTaskNotifyGiveIndexedFromISR(TaskHandle_t task, UBaseType_t index, BaseType_t *woken)
{
    pthread_mutex_lock(&lock);
    task->value[index]++;
    freertos_given++;
    if (woken)
        *woken = pdTRUE;
    pthread_cond_broadcast(&changed);
    pthread_mutex_unlock(&lock);
}

SemaphoreHandle_t xSemaphoreCreateMutexStatic(StaticSemaphore_t *memory)
{
    memory->holder = NULL;
    return memory;
}

BaseType_t xSemaphoreTake(SemaphoreHandle_t mutex, TickType_t ticks)
{
    const struct timespec end = after(ticks);
    BaseType_t taken;

    pthread_mutex_lock(&lock);
    while (mutex->holder && sleep_until(&end, ticks))
        ;
    taken = mutex->holder == NULL;
    if (taken)
        mutex->holder = &self;
    pthread_mutex_unlock(&lock);
    return taken;
}

/* As FreeRTOS, only the task that has the mutex may give it. */
BaseType_t xSemaphoreGive(SemaphoreHandle_t mutex)
{
    pthread_mutex_lock(&lock);
    assert(mutex->holder == &self);
    mutex->holder = NULL;
    pthread_cond_broadcast(&changed);
    pthread_mutex_unlock(&lock);
    return pdTRUE;
}
