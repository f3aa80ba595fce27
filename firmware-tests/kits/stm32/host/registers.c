#define _GNU_SOURCE
#include "registers.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/ucontext.h>
#include <unistd.h>

enum { PAGE = 4096, PAGES = 8, SINGLE_STEP = 0x100, WRITE = 2 };

static uint32_t pages[PAGES];
static unsigned page_count;
static uint32_t address;
static int isWrite;

static void *at(uint32_t place)
{
    return (void *)(uintptr_t)place;
}

static void fail(const char *reason)
{
    perror(reason);
    abort();
}

/* The program wants to access a register: lets it do one instruction. */
static void on_access(int signal, siginfo_t *info, void *given)
{
    ucontext_t *context = given;
    uintptr_t place = (uintptr_t)info->si_addr;
    unsigned i;

    (void)signal;
    for (i = 0; i < page_count; i++)
        if (place - pages[i] < PAGE)
            break;
    if (i == page_count) {
        fprintf(stderr, "no register at %#lx\n", (unsigned long)place);
        abort();
    }
    address = (uint32_t)place;
    isWrite = (context->uc_mcontext.gregs[REG_ERR] & WRITE) != 0;
    chip_before(address);
    mprotect(at(pages[i]), PAGE, PROT_READ | PROT_WRITE);
    context->uc_mcontext.gregs[REG_EFL] |= SINGLE_STEP;
}

static void on_step(int signal, siginfo_t *info, void *given)
{
    ucontext_t *context = given;

    (void)signal;
    (void)info;
    context->uc_mcontext.gregs[REG_EFL] &= ~SINGLE_STEP;
    mprotect(at(address / PAGE * PAGE), PAGE, PROT_NONE);
    chip_after(address, isWrite);
}

uint8_t *registers_map(uint32_t page)
{
    int file = memfd_create("registers", 0);
    void *open;

    if (file < 0 || ftruncate(file, PAGE))
        fail("memfd_create");
    open = mmap(NULL, PAGE, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    if (open == MAP_FAILED ||
        mmap(at(page), PAGE, PROT_NONE, MAP_SHARED | MAP_FIXED_NOREPLACE, file, 0) != at(page))
        fail("mmap");
    pages[page_count++] = page;
    return open;
}

void registers_catch(void)
{
    struct sigaction action;

    memset(&action, 0, sizeof action);
    action.sa_flags = SA_SIGINFO;
    action.sa_sigaction = on_access;
    sigaction(SIGSEGV, &action, NULL);
    action.sa_sigaction = on_step;
    sigaction(SIGTRAP, &action, NULL);
}

void registers_plain(uint32_t page)
{
    if (mmap(at(page), PAGE, PROT_READ | PROT_WRITE,
             MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED_NOREPLACE, -1, 0) != at(page))
        fail("mmap");
}
