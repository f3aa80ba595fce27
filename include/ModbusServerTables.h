/**
 * @file ModbusServerTables.h
 * @brief Registers, bits and functions that a ModbusServer serves.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusServer.h.
 */

#ifndef MODBUSSERVERTABLES_H
#define MODBUSSERVERTABLES_H

#include <stddef.h>
#include <stdint.h>

#include "mbm/server.h"

/**
 * Functions of yours that are called around the requests to a table: pass the object to
 * setHooks of each table. It must outlive the tables.
 *
 * A hook gets the request: its unit and function, the address on the wire of the first cell,
 * the number of cells and, for a write, the new values: registers with the high byte first,
 * bits with the lowest bit first. A cell is a register or a bit.
 */
class ModbusHooks {
public:
    /** No hooks yet. */
    ModbusHooks() : hooks(), onRead(), onWrite(), onWritten() { hooks.context = this; }
    ModbusHooks(const ModbusHooks &) = delete;
    ModbusHooks &operator=(const ModbusHooks &) = delete;

    /**
     * Sets a hook that is called before a request reads cells, and may set them. It
     * returns 0, or an exception code that refuses the whole request. nullptr for none.
     */
    void beforeRead(uint8_t (*hook)(const mbm_access &access))
    {
        onRead = hook;
        hooks.beforeRead = hook != nullptr ? readHook : nullptr;
    }
    /**
     * Sets a hook that is called before a request writes cells. It returns 0, or an
     * exception code that refuses the whole request. nullptr for none.
     */
    void beforeWrite(uint8_t (*hook)(const mbm_access &access))
    {
        onWrite = hook;
        hooks.beforeWrite = hook != nullptr ? writeHook : nullptr;
    }
    /** Sets a hook that is called after a request has written cells; nullptr for none. */
    void afterWrite(void (*hook)(const mbm_access &access))
    {
        onWritten = hook;
        hooks.afterWrite = hook != nullptr ? writtenHook : nullptr;
    }

private:
    template <typename Table> friend class ModbusTable;

    mbm_accessHooks hooks;
    uint8_t (*onRead)(const mbm_access &);
    uint8_t (*onWrite)(const mbm_access &);
    void (*onWritten)(const mbm_access &);

    static uint8_t readHook(void *context, const mbm_access *access)
    {
        return static_cast<ModbusHooks *>(context)->onRead(*access);
    }
    static uint8_t writeHook(void *context, const mbm_access *access)
    {
        return static_cast<ModbusHooks *>(context)->onWrite(*access);
    }
    static void writtenHook(void *context, const mbm_access *access)
    {
        static_cast<ModbusHooks *>(context)->onWritten(*access);
    }
};

/** The members that ModbusRegisters and ModbusBits share. A cell is a register or a bit. */
template <typename Table> class ModbusTable {
public:
    ModbusTable(const ModbusTable &) = delete;
    ModbusTable &operator=(const ModbusTable &) = delete;

    /** Sets the hooks around requests to the table; other tables may have them too. */
    void setHooks(const ModbusHooks &hooks) { set(&table, &hooks.hooks); }
    /** Takes the hooks away. */
    void removeHooks() { set(&table, nullptr); }
    /**
     * Says which cells exist: one bit for each, lowest bit of the first byte first.
     * A request for another cell is answered with exception 02. nullptr: all exist.
     */
    void setValid(const uint8_t *bits) { table.valid = bits; }
    /** The address of the first cell. */
    uint16_t address() const { return table.base; }
    /** How many cells the table has. */
    uint16_t size() const { return table.size; }

protected:
    /** @cond for ModbusRegisters and ModbusBits */
    ModbusTable(uint16_t size, uint16_t address) : table()
    {
        table.size = size;
        table.base = address;
    }

    Table table;
    /** @endcond */

private:
    friend class ModbusUnit;

    Table *record() { return &table; }

    static void set(mbm_registerTable *table, const mbm_accessHooks *hooks)
    {
        mbm_registerTable_setHooks(table, hooks);
    }
    static void set(mbm_bitTable *table, const mbm_accessHooks *hooks)
    {
        mbm_bitTable_setHooks(table, hooks);
    }
};

/** Holding or input registers in an array that you provide. */
class ModbusRegisters : public ModbusTable<mbm_registerTable> {
public:
    /** All words of an array, from `address` on. */
    template <size_t N>
    ModbusRegisters(uint16_t (&words)[N], uint16_t address = 0)
        : ModbusRegisters(words, N, address)
    {
        static_assert(N <= 65535, "a table has at most 65535 registers");
    }
    /** `quantity` words, from `address` on. */
    ModbusRegisters(uint16_t *words, uint16_t quantity, uint16_t address)
        : ModbusTable(quantity, address)
    {
        table.words = words;
    }

    /** The register `index`, counted from the first of the table: below size(). */
    uint16_t &operator[](uint16_t index) { return table.words[index]; }
    /** @copydoc operator[] */
    const uint16_t &operator[](uint16_t index) const { return table.words[index]; }
};

/** Coils or discrete inputs in an array that you provide, lowest bit of a byte first. */
class ModbusBits : public ModbusTable<mbm_bitTable> {
public:
    /** All bits of an array, eight to a byte, from `address` on. */
    template <size_t N>
    ModbusBits(uint8_t (&bytes)[N], uint16_t address = 0) : ModbusBits(bytes, N * 8, address)
    {
        static_assert(N <= 8191, "a table has at most 65535 bits");
    }
    /** `quantity` bits, from `address` on. */
    ModbusBits(uint8_t *bytes, uint16_t quantity, uint16_t address)
        : ModbusTable(quantity, address)
    {
        table.bits = bytes;
    }

    /** The bit `index`, counted from the first of the table: below size(). */
    bool operator[](uint16_t index) const { return (table.bits[index / 8] >> index % 8 & 1) != 0; }
    /** Sets the bit `index`, which is below size(). */
    void set(uint16_t index, bool on)
    {
        uint8_t bit = static_cast<uint8_t>(1u << index % 8);
        uint8_t &byte = table.bits[index / 8];
        byte = static_cast<uint8_t>(on ? byte | bit : byte & ~bit);
    }
};

/** Registers with their own storage, all 0 at first. */
template <uint16_t Quantity> class ModbusRegisterArray : public ModbusRegisters {
public:
    /** The first one has this address. */
    ModbusRegisterArray(uint16_t address = 0)
        : ModbusRegisters(storage, Quantity, address), storage()
    {
    }

private:
    uint16_t storage[Quantity];
};

/** Bits with their own storage, all 0 at first. */
template <uint16_t Quantity> class ModbusBitArray : public ModbusBits {
public:
    /** The first one has this address. */
    ModbusBitArray(uint16_t address = 0) : ModbusBits(storage, Quantity, address), storage() {}

private:
    uint8_t storage[(Quantity + 7u) / 8u];
};

/** A user-defined function, for ModbusUnit::function. */
class ModbusFunction {
public:
    /**
     * @param code     1 to 127, of which the standard leaves 65 to 72 and 100 to 110 to
     *                 users; 0 is every function that no object before it serves
     * @param handler  writes the data of the response, at most `capacity` bytes, and
     *                 returns how many; or MBM_REPLY_EXCEPTION | code,
     *                 MBM_REPLY_NONE, MBM_REPLY_PENDING to be called again, or
     *                 MBM_REPLY_DECLINED to let the next object answer
     */
    ModbusFunction(uint8_t code, uint16_t (*handler)(const mbm_request &request, uint8_t *response,
                                                     uint16_t capacity))
        : custom(), handle(handler)
    {
        custom.code = code;
        custom.context = this;
        custom.serve = handler != nullptr ? serveHook : nullptr;
    }
    ModbusFunction(const ModbusFunction &) = delete;
    ModbusFunction &operator=(const ModbusFunction &) = delete;

private:
    friend class ModbusUnit;

    mbm_custom custom;
    uint16_t (*handle)(const mbm_request &, uint8_t *, uint16_t);

    mbm_custom *record() { return &custom; }

    static uint16_t serveHook(void *context, const mbm_request *request, uint8_t *response,
                              uint16_t capacity)
    {
        return static_cast<ModbusFunction *>(context)->handle(*request, response, capacity);
    }
};

#endif
