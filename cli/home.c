/* The kinds of entities, device classes and state classes of Home Assistant. */
#include "home.h"

#include <string.h>

enum { LONGEST_TEXT = 255 };

const char *const home_components[] = {"sensor", "binary_sensor", "number", "switch",
                                       "select", "text",          "button", NULL};
const char *const home_states[] = {"none",  "measurement",      "measurement_angle",
                                   "total", "total_increasing", NULL};

/* --- the kind of an entity --- */

int home_is_bit(const mbm_planField *planned)
{
    return planned->type == MBM_TYPE_BIT && planned->count == 1;
}

int home_is_several(const mbm_planField *planned)
{
    return device_values_in(planned) > 1;
}

/* The numbers of an enumeration have no scale. */
int home_has_names(const device_field *field, const mbm_planField *planned)
{
    return field->label_count > 0 && field->form.scale.digits == 0 && !home_is_bit(planned) &&
           !home_is_several(planned);
}

int home_is_number(const device_field *field, const mbm_planField *planned)
{
    return !value_is_text(planned->type) && !value_is_date(planned->type) &&
           !home_is_bit(planned) && !home_is_several(planned) && !home_has_names(field, planned);
}

int home_component(const device_field *field, const mbm_planField *planned)
{
    const int is_written = field->access & DEVICE_WRITE;

    if (field->press)
        return HOME_BUTTON;
    /* Several values are a text if they are written: Home Assistant has no list of numbers. */
    if (home_is_several(planned))
        return is_written ? HOME_TEXT : HOME_SENSOR;
    if (value_is_date(planned->type))
        return is_written ? HOME_TEXT : HOME_SENSOR;
    if (value_is_text(planned->type))
        return is_written && planned->count <= LONGEST_TEXT ? HOME_TEXT : HOME_SENSOR;
    if (home_is_bit(planned))
        return is_written ? HOME_SWITCH : HOME_BINARY_SENSOR;
    if (is_written && home_has_names(field, planned))
        return HOME_SELECT;
    return is_written ? HOME_NUMBER : HOME_SENSOR;
}

/* --- device classes --- */

#define MEASURED (1u << HOME_MEASUREMENT)
#define COUNTED (1u << HOME_TOTAL | 1u << HOME_INCREASING)
#define LENGTH "mm|cm|m|km|in|ft|yd|mi|nmi"
#define PRESSURE "mPa|Pa|hPa|kPa|bar|cbar|mbar|mmHg|inHg|inH\u2082O|psi|atm"
#define ENERGY "J|kJ|MJ|GJ|mWh|Wh|kWh|MWh|GWh|TWh|cal|kcal|Mcal|Gcal|thm"
#define SPEED "mm/s|m/s|m/min|km/h|mph|kn|ft/s|in/s"
#define FLUX "in/d|in/h|mm/d|mm/h"
#define VOLUME "ft\u00B3|CCF|MCF|m\u00B3|L|mL|gal|fl. oz."
#define MICROGRAMS "\u03BCg/m\u00B3"

/* Of sensors and numbers. */
static const home_class NUMBERS[] = {
    {"absolute_humidity", "g/m\u00B3|mg/m\u00B3", 0, MEASURED},
    {"apparent_power", "mVA|VA|kVA", 0, MEASURED},
    {"aqi", "", 1, MEASURED},
    {"area", "mm\u00B2|cm\u00B2|m\u00B2|km\u00B2|in\u00B2|ft\u00B2|yd\u00B2|mi\u00B2|ac|ha", 0,
     MEASURED | COUNTED},
    {"atmospheric_pressure", PRESSURE, 0, MEASURED},
    {"battery", "%", 0, MEASURED},
    {"carbon_dioxide", "ppm", 0, MEASURED},
    {"carbon_monoxide", "ppb|ppm|mg/m\u00B3|" MICROGRAMS, 0, MEASURED},
    {"conductivity", "S/cm|mS/cm|\u03BCS/cm", 0, MEASURED},
    {"current", "\u03BCA|mA|A", 0, MEASURED},
    {"distance", LENGTH, 0, MEASURED | COUNTED},
    {"duration", "\u03BCs|ms|s|min|h|d", 0, MEASURED | COUNTED},
    {"energy", ENERGY, 0, COUNTED},
    {"energy_distance", "kWh/100km|Wh/km|mi/kWh|km/kWh", 0, MEASURED},
    {"energy_storage", ENERGY, 0, MEASURED},
    {"frequency", "mHz|Hz|kHz|MHz|GHz", 0, MEASURED},
    {"gas", "ft\u00B3|CCF|MCF|m\u00B3|L", 0, COUNTED},
    {"humidity", "%", 0, MEASURED},
    {"illuminance", "lx", 0, MEASURED},
    {"irradiance", "W/m\u00B2|BTU/(h\u22C5ft\u00B2)", 0, MEASURED},
    {"moisture", "%", 0, MEASURED},
    {"nitrogen_dioxide", "ppb|ppm|" MICROGRAMS, 0, MEASURED},
    {"nitrogen_monoxide", "ppb|" MICROGRAMS, 0, MEASURED},
    {"nitrous_oxide", MICROGRAMS, 0, MEASURED},
    {"ozone", "ppb|ppm|" MICROGRAMS, 0, MEASURED},
    {"ph", "", 1, MEASURED},
    {"pm1", MICROGRAMS, 0, MEASURED},
    {"pm10", MICROGRAMS, 0, MEASURED},
    {"pm25", MICROGRAMS, 0, MEASURED},
    {"power", "mW|W|kW|MW|GW|TW", 0, MEASURED},
    {"power_factor", "%", 1, MEASURED},
    {"precipitation", "in|mm|cm", 0, MEASURED | COUNTED},
    {"precipitation_intensity", FLUX, 0, MEASURED},
    {"pressure", PRESSURE, 0, MEASURED},
    {"reactive_energy", "varh|kvarh", 0, COUNTED},
    {"reactive_power", "mvar|var|kvar", 0, MEASURED},
    {"signal_strength", "dB|dBm", 0, MEASURED},
    {"sound_pressure", "dB|dBA", 0, MEASURED},
    {"speed", SPEED "|" FLUX, 0, MEASURED},
    {"sulphur_dioxide", "ppb|" MICROGRAMS, 0, MEASURED},
    {"temperature", "\u00B0C|\u00B0F|K", 0, MEASURED},
    {"temperature_delta", "\u00B0C|\u00B0F|K", 0, MEASURED},
    {"volatile_organic_compounds", MICROGRAMS "|mg/m\u00B3", 0, MEASURED},
    {"volatile_organic_compounds_parts", "ppb|ppm", 0, MEASURED},
    {"voltage", "\u03BCV|mV|V|kV|MV", 0, MEASURED},
    {"volume", VOLUME, 0, COUNTED},
    {"volume_flow_rate",
     "m\u00B3/h|m\u00B3/min|m\u00B3/s|ft\u00B3/min|L/h|L/min|L/s|gal/h|gal/min|gal/d|mL/s", 0,
     MEASURED},
    {"volume_storage", VOLUME, 0, MEASURED},
    {"water", "ft\u00B3|CCF|MCF|m\u00B3|gal|L", 0, COUNTED},
    {"weight", "\u03BCg|mg|g|kg|oz|lb|st", 0, MEASURED | COUNTED},
    {"wind_direction", "\u00B0", 0, 1u << HOME_ANGLE},
    {"wind_speed", SPEED, 0, MEASURED},
};

#define ANY_UNIT(name)                                                                             \
    {                                                                                              \
        name, NULL, 1, 0                                                                           \
    }
static const home_class BITS[] = {
    ANY_UNIT("battery"),
    ANY_UNIT("battery_charging"),
    ANY_UNIT("carbon_monoxide"),
    ANY_UNIT("cold"),
    ANY_UNIT("connectivity"),
    ANY_UNIT("door"),
    ANY_UNIT("garage_door"),
    ANY_UNIT("gas"),
    ANY_UNIT("heat"),
    ANY_UNIT("light"),
    ANY_UNIT("lock"),
    ANY_UNIT("moisture"),
    ANY_UNIT("motion"),
    ANY_UNIT("moving"),
    ANY_UNIT("occupancy"),
    ANY_UNIT("opening"),
    ANY_UNIT("plug"),
    ANY_UNIT("power"),
    ANY_UNIT("presence"),
    ANY_UNIT("problem"),
    ANY_UNIT("running"),
    ANY_UNIT("safety"),
    ANY_UNIT("smoke"),
    ANY_UNIT("sound"),
    ANY_UNIT("tamper"),
    ANY_UNIT("update"),
    ANY_UNIT("vibration"),
    ANY_UNIT("window"),
};
static const home_class SWITCHES[] = {ANY_UNIT("outlet"), ANY_UNIT("switch")};
static const home_class BUTTONS[] = {ANY_UNIT("identify"), ANY_UNIT("restart"), ANY_UNIT("update")};

unsigned home_classes(int component, const home_class **classes)
{
    switch (component) {
    case HOME_SENSOR:
    case HOME_NUMBER: *classes = NUMBERS; return sizeof NUMBERS / sizeof NUMBERS[0];
    case HOME_BINARY_SENSOR: *classes = BITS; return sizeof BITS / sizeof BITS[0];
    case HOME_SWITCH: *classes = SWITCHES; return sizeof SWITCHES / sizeof SWITCHES[0];
    case HOME_BUTTON: *classes = BUTTONS; return sizeof BUTTONS / sizeof BUTTONS[0];
    default: *classes = NULL; return 0;
    }
}

const home_class *home_find_class(int component, const char *name)
{
    const home_class *classes;
    unsigned count = home_classes(component, &classes);

    while (count-- > 0)
        if (strcmp(classes[count].name, name) == 0)
            return &classes[count];
    return NULL;
}

/* --- units --- */

/* Other ways to write units, which Home Assistant takes for the same. */
static const char *const SAME[][2] = {
    {"\u00B5A", "\u03BCA"},
    {"\u00B5V", "\u03BCV"},
    {"\u00B5s", "\u03BCs"},
    {"\u00B5g", "\u03BCg"},
    {"\u00B5S/cm", "\u03BCS/cm"},
    {"\u00B5g/m\u00B3", MICROGRAMS},
    {"VAr", "var"},
    {"kVAr", "kvar"},
    {"VArh", "varh"},
    {"kVArh", "kvarh"},
};

int home_has_unit(const home_class *of, const char *unit)
{
    const char *at;
    size_t i, length;

    if (!of->units)
        return 1;
    if (!unit)
        return of->is_unit_free;
    for (i = 0; i < sizeof SAME / sizeof SAME[0]; i++)
        if (strcmp(unit, SAME[i][0]) == 0)
            unit = SAME[i][1];
    for (at = of->units; *at; at += length + (at[length] == '|')) {
        length = strcspn(at, "|");
        if (strlen(unit) == length && strncmp(at, unit, length) == 0)
            return 1;
    }
    return 0;
}

/* --- what goes with a unit of measurement --- */

/* Only classes and units that Home Assistant has had for years: an older one refuses an entity with
 * a class that it does not know. */
static const struct {
    const char *units, *name;
} SUGGESTED[] = {
    {"Wh|kWh|MWh|GJ", "energy"},
    {"W|kW|MW", "power"},
    {"VA", "apparent_power"},
    {"var", "reactive_power"},
    {"mV|V", "voltage"},
    {"mA|A", "current"},
    {"Hz|kHz|MHz", "frequency"},
    {"\u00B0C|\u00B0F|K", "temperature"},
    {"Pa|hPa|kPa|bar|mbar|psi", "pressure"},
    {"lx", "illuminance"},
    {"W/m\u00B2", "irradiance"},
    {"m\u00B3/h|L/min", "volume_flow_rate"},
    {"mm|cm|m|km", "distance"},
    {"s|min|h|d", "duration"},
    {"m/s|km/h", "speed"},
    {"kg|g", "weight"},
    {"dBm", "signal_strength"},
    /* Measured, but a class cannot be known. */
    {"%|ppm|ppb|rpm|\u00B0|l/min|l/h|l/s|L/h|L/s|dB|kVA|kvar", NULL},
};

/* Finds what goes with a unit: the class, or NULL. Returns 0 if nothing is known of the unit. */
static int suggest(const char *unit, const char **name)
{
    size_t i;

    for (i = 0; unit && i < sizeof SUGGESTED / sizeof SUGGESTED[0]; i++) {
        const home_class units = {.units = SUGGESTED[i].units};

        if (!home_has_unit(&units, unit))
            continue;
        *name = SUGGESTED[i].name;
        return 1;
    }
    return 0;
}

/* Whether a field may take the class that goes with its unit. */
static int takes_suggestion(const device_field *field, const mbm_planField *planned)
{
    const int component = home_component(field, planned);

    return (component == HOME_SENSOR || component == HOME_NUMBER) && home_is_number(field, planned);
}

/* The class of a date that is read: a moment or a day. A time of day has none. */
static const char *date_class(const device_field *field, const mbm_planField *planned)
{
    if (!value_is_date(planned->type) || home_component(field, planned) != HOME_SENSOR ||
        home_is_several(planned) || (field->layout && !strchr(field->layout, 'M')))
        return NULL;
    return field->layout && !strchr(field->layout, 'h') ? "date" : "timestamp";
}

const char *home_class_of(const device_field *field, const mbm_planField *planned)
{
    const char *name = date_class(field, planned);

    if (field->device_class)
        return strcmp(field->device_class, "none") == 0 ? NULL : field->device_class;
    if (takes_suggestion(field, planned))
        (void)suggest(field->unit_of_measurement, &name);
    return name;
}

int home_state_of(const device_field *field, const mbm_planField *planned)
{
    const char *name = home_class_of(field, planned), *suggested = NULL;
    const home_class *of = name ? home_find_class(HOME_SENSOR, name) : NULL;

    if (home_component(field, planned) != HOME_SENSOR || !home_is_number(field, planned))
        return HOME_NO_STATE;
    if (field->has_state_class)
        return field->state_class;
    if (of)
        return of->states & MEASURED ? HOME_MEASUREMENT : HOME_NO_STATE;
    return suggest(field->unit_of_measurement, &suggested) && !suggested ? HOME_MEASUREMENT
                                                                         : HOME_NO_STATE;
}
