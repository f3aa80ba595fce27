/**
 * @file ModbusMasterTurn.h
 * @brief What the objects of ModbusMaster know of each other.
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
 * The object that sent a request last. The gap before the request of another object
 * counts from the last use of a line by any object, as all may share one. A template,
 * since C++11 gives only a template's statics a home in a header.
 */
template <typename Unused> class ModbusMasterTurn {
#if defined(MODBUSMASTER_SHARE_FRAME)
public:
    /** False while another object has a request under way in the frame that all share. */
    static bool take(mbm_master &master)
    {
        return shared.master == &master || mbm_master_takeTurn(&master, &shared) == MBM_OK;
    }
    /** An object goes. */
    static void end(mbm_master &master) { mbm_master_endTurn(&master, &shared); }
    /** A line was used just now: the object itself knows. */
    static void used() {}

private:
    static mbm_turn shared;
#else
public:
    /** True: each object has a frame of its own. */
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
    // Never looked into. Threads that race for it, each with a line of its own, cost a
    // needless gap at most.
    static const mbm_master *last;
    static uint32_t lastUse;
#endif
};

/** @cond the homes of what is declared above */
#if defined(MODBUSMASTER_SHARE_FRAME)
template <typename Unused> mbm_turn ModbusMasterTurn<Unused>::shared = {nullptr, 0};
#else
template <typename Unused> const mbm_master *ModbusMasterTurn<Unused>::last = nullptr;
template <typename Unused> uint32_t ModbusMasterTurn<Unused>::lastUse = 0;
#endif
/** @endcond */

#endif
