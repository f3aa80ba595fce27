/* The data cache of an H7, between the processor and the memory that its DMA sees. It does the
 * worst that a write-back cache may do: what the processor has written reaches the memory when the
 * program cleans the line, or at the moment when the DMA writes into the same line; what the DMA
 * has written reaches the processor when the program invalidates the line, which drops what the
 * processor has written to it meanwhile. The functions that clean and invalidate are CMSIS's. */
#include "chip.h"

#include <stdlib.h>
#include <string.h>

enum { LINE = 32, INVALIDATE = 0xF5C, CLEAN = 0xF68, CLEAN_AND_INVALIDATE = 0xF70 };

/* Data of the program, from the linker. What the processor reads and writes is its cache. */
extern uint8_t __data_start, _end;

static uint8_t *memory; /* as the DMA sees it */
static uint8_t *filled; /* each line when cache and memory were last the same */
static uint32_t first;
static uint8_t *scs;

static uint8_t *cached(uint32_t line)
{
    return (uint8_t *)(uintptr_t)line;
}

static void clean(uint32_t line)
{
    if (memcmp(cached(line), filled + (line - first), LINE) == 0)
        return;
    memcpy(memory + (line - first), cached(line), LINE);
    memcpy(filled + (line - first), cached(line), LINE);
}

static void invalidate(uint32_t line)
{
    memcpy(cached(line), memory + (line - first), LINE);
    memcpy(filled + (line - first), cached(line), LINE);
}

void cache_start(uint8_t *registers)
{
    uint32_t size;

    scs = registers;
    ((SCB_Type *)(scs + SCB_BASE % 4096))->CCR = SCB_CCR_DC_Msk;
    first = (uint32_t)(uintptr_t)&__data_start / LINE * LINE;
    size = (uint32_t)(uintptr_t)&_end - first;
    if (!memory) {
        memory = malloc(size + LINE);
        filled = malloc(size + LINE);
    }
    memcpy(memory, cached(first), size);
    memcpy(filled, cached(first), size);
}

void cache_after(uint32_t offset, int isWrite)
{
    uint32_t line = *(uint32_t *)(scs + offset) / LINE * LINE;

    if (!isWrite)
        return;
    if (offset == CLEAN || offset == CLEAN_AND_INVALIDATE)
        clean(line);
    if (offset == INVALIDATE || offset == CLEAN_AND_INVALIDATE)
        invalidate(line);
}

void dma_write(uint32_t address, uint8_t byte)
{
    memory[address - first] = byte;
    clean(address / LINE * LINE);
}

uint8_t dma_read(uint32_t address)
{
    return memory[address - first];
}
