/* The function code with which a unit answers a request. */
#ifndef ANSWER_H
#define ANSWER_H

#include "crc.h"
#include "mbm.h"
#include "test.h"

#include <string.h>

/* Lets a unit serve a PDU in an RTU frame to the unit `id`. Returns the function code of the
 * response, or 0 if there is none. */
static inline unsigned answer(mbm_unit *unit, uint8_t id, const char *pdu, size_t length)
{
    uint8_t frame[MBM_MAX_FRAME];
    uint16_t response = 0xFFFF;

    frame[0] = id;
    memcpy(frame + 1, pdu, length);
    length = seal(frame, length + 1);
    OK(mbm_unit_respond(unit, 1, NULL, FRAMING(MBM_FRAMING_RTU), frame, (uint16_t)length,
                        sizeof frame, &response));
    assert_int_not_equal(response, 0xFFFF);
    return response == 0 ? 0 : frame[1];
}

#endif
