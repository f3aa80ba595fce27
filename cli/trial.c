#include "trial.h"

static int16_t read_nothing(void *context, uint8_t *bytes, uint16_t capacity)
{
    (void)context;
    (void)bytes;
    (void)capacity;
    return 0;
}

static int16_t write_nothing(void *context, const uint8_t *bytes, uint16_t length)
{
    (void)context;
    (void)bytes;
    (void)length;
    return 0;
}

static uint32_t no_time(void *context)
{
    (void)context;
    return 0;
}

uint8_t trial_begin(mbm_plan *plan, const mbm_planSetup *setup, uint16_t *wrong)
{
    static const mbm_port nowhere = {
        .read = read_nothing, .write = write_nothing, .micros = no_time};
    static mbm_client client = MBM_INIT;
    static uint8_t frame[MBM_MAX_FRAME];

    (void)mbm_client_beginRtuOverTcp(&client, &nowhere, frame, sizeof frame);
    return mbm_plan_begin(plan, &client, setup, wrong);
}
