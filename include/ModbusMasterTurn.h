/**
 * @file ModbusMasterTurn.h
 * @brief Orders the requests of several ModbusMaster objects.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusMaster.h.
 */

#ifndef MODBUSMASTER_TURN_H
#define MODBUSMASTER_TURN_H

#include <Arduino.h>
#include <stdint.h>

#include "ModbusMasterOptions.h"
#include "mbm.h"

/**
 * The object that sent the last request. All objects may share a line: so the silence
 * before a request counts from the last use of a line by any object. It is a template,
 * because in C++11 only a template's static members can be defined in a header.
 */
template <typename Unused> class ModbusMasterTurn {
#if defined(MODBUSMASTER_SHARE_FRAME)
public:
    /** False while another object has a request under way. */
    static bool take(mbm_master &master)
    {
        return shared.master == &master || mbm_master_takeTurn(&master, &shared) == MBM_OK;
    }
    /** Called by the destructor of an object. */
    static void end(mbm_master &master) { mbm_master_endTurn(&master, &shared); }
    /** A line was used just now; mbm_turn records that itself. */
    static void used() {}

private:
    static mbm_turn shared;
#else
public:
    /** Always true: each object has its own frame buffer. */
    static bool take(mbm_master &master)
    {
        if (last != &master) {
            last = &master;
            mbm_master_lineUsedAt(&master, lastUse);
        }
        return true;
    }
    /** A line was used just now. */
    static void used() { lastUse = micros() & 0xFFFFFFFFu; }

private:
    // The pointer is only compared. Two threads, each with its own line, may race for it;
    // at worst one of them waits for a silence that was not needed.
    static const mbm_master *last;
    static uint32_t lastUse;
#endif
};

/** @cond the definitions of the static members */
#if defined(MODBUSMASTER_SHARE_FRAME)
template <typename Unused> mbm_turn ModbusMasterTurn<Unused>::shared = {nullptr, 0};
#else
template <typename Unused> const mbm_master *ModbusMasterTurn<Unused>::last = nullptr;
template <typename Unused> uint32_t ModbusMasterTurn<Unused>::lastUse = 0;
#endif
/** @endcond */

#endif
