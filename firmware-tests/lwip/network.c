#include "network.h"
#include "lan9118.h"
#include "mps2.h"

#include "lwip/netif.h"
#include "lwip/tcpip.h"

#include <string.h>

#define NVIC_ENABLE (*(volatile uint32_t *)0xE000E100u)
#define NVIC_PRIORITY(number) (*(volatile uint8_t *)(uintptr_t)(0xE000E400u + (number)))
#define VECTOR_TABLE (*(volatile uint32_t *)0xE000ED08u)

enum { ETHERNET = 13, SYSTEM = 16, OF_MPS2 = 20, VECTORS = 32, LINK_WATCH_MS = 50, STACKS = 12 };

TaskHandle_t network_driver, network_lwip;
static struct netif netif;
static struct {
    TaskHandle_t task;
    unsigned words;
} stacks[STACKS];

unsigned board_random(void)
{
    static uint32_t state = 2463534242u;

    state ^= state << 13;
    state ^= state >> 17;
    state ^= state << 5;
    return state ^ xTaskGetTickCount();
}

static void ethernet_handler(void)
{
    BaseType_t woken = pdFALSE;

    lan9118_interrupt(0);
    vTaskNotifyGiveFromISR(network_driver, &woken);
    portYIELD_FROM_ISR(woken);
}

/* The vectors of mps2.c, copied to RAM, with one more. */
static void add_vector(void)
{
    static uint32_t table[VECTORS] __attribute__((aligned(256)));
    const volatile uint32_t *flash = (const volatile uint32_t *)VECTOR_TABLE;
    unsigned i;

    for (i = 0; i < OF_MPS2; i++)
        table[i] = flash[i];
    table[SYSTEM + ETHERNET] = (uint32_t)(uintptr_t)ethernet_handler;
    VECTOR_TABLE = (uint32_t)(uintptr_t)table;
    NVIC_PRIORITY(ETHERNET) = configMAX_SYSCALL_INTERRUPT_PRIORITY;
    NVIC_ENABLE = 1u << ETHERNET;
}

/* Hands received frames to lwIP, and watches the cable. */
static void drive(void *none)
{
    (void)none;
    add_vector();
    for (;;) {
        const int has_link = lan9118_hasLink();

        if (has_link != (int)netif_is_link_up(&netif)) {
            LOCK_TCPIP_CORE();
            if (has_link)
                netif_set_link_up(&netif);
            else
                netif_set_link_down(&netif);
            UNLOCK_TCPIP_CORE();
        }
        while (lan9118_receive(&netif)) {
        }
        lan9118_interrupt(1);
        (void)ulTaskNotifyTake(pdTRUE, pdMS_TO_TICKS(LINK_WATCH_MS));
    }
}

static void (*call_ready)(void *none);

static void is_running(void *none)
{
    ip4_addr_t address, mask, gateway;

    network_lwip = xTaskGetCurrentTaskHandle();
    IP4_ADDR(&address, 10, 0, 2, 15);
    IP4_ADDR(&mask, 255, 255, 255, 0);
    IP4_ADDR(&gateway, 10, 0, 2, 2);
    (void)netif_add(&netif, &address, &mask, &gateway, NULL, lan9118_init, tcpip_input);
    netif_set_default(&netif);
    netif_set_up(&netif);
    network_driver = network_task(drive, "driver", NULL, 300);
    call_ready(none);
}

/* lwIP's task is made by lwIP, and its stack is known from lwipopts.h. */
void network_begin(void (*ready)(void *none))
{
    call_ready = ready;
    tcpip_init(is_running, NULL);
}

TaskHandle_t network_task(TaskFunction_t run, const char *name, void *parameter, unsigned words)
{
    TaskHandle_t task = NULL;
    unsigned i = 0;

    while (stacks[i].task != NULL)
        i++;
    configASSERT(xTaskCreate(run, name, words, parameter, 3, &task) == pdPASS);
    stacks[i].task = task;
    stacks[i].words = words;
    return task;
}

unsigned network_stackUsed(TaskHandle_t task)
{
    unsigned words = TCPIP_THREAD_STACKSIZE, i;

    for (i = 0; i < STACKS; i++)
        if (stacks[i].task == task)
            words = stacks[i].words;
    return 4u * (words - (unsigned)uxTaskGetStackHighWaterMark(task));
}
