/* ==== Values in words: each in one call =============================================== */

/**
 * A number of two words, 0 to 4294967295.
 *
 * The functions of this section are inline, and return the number itself. They know no end of the
 * words: an array of yours must have as many as the number. Where the words come with a count, take
 * mbm_registers_ofWords.
 *
 * @param words  the first of them: `&response[6]` for the seventh response word of mbm_node
 * @param order  one of MBM_ORDER_...; MBM_ORDER_DEFAULT for MBM_ORDER_ABCD
 * @return the number; 0 if `words` is NULL or there is no such order
 */
static inline uint32_t mbm_words_getUint32(const uint16_t *words, uint8_t order)
{
    const mbm_registers view = {words, 0, 2, MBM_REGISTERS_OF_WORDS, MBM_ORDER_ABCD};
    uint32_t number = 0;

    (void)mbm_registers_getUint32(&view, 0, order, &number);
    return number;
}

/**
 * As mbm_words_getUint32, with a sign, in two's complement.
 *
 * @return the number; 0 if `words` is NULL or there is no such order
 */
static inline int32_t mbm_words_getInt32(const uint16_t *words, uint8_t order)
{
    const mbm_registers view = {words, 0, 2, MBM_REGISTERS_OF_WORDS, MBM_ORDER_ABCD};
    int32_t number = 0;

    (void)mbm_registers_getUint32(&view, 0, order, (uint32_t *)&number);
    return number;
}

/**
 * As mbm_words_getUint32, for a float of two words, an IEEE 754 binary32. Its bits are copied.
 *
 * @return the number; a NaN if `words` is NULL or there is no such order
 */
static inline float mbm_words_getFloat(const uint16_t *words, uint8_t order)
{
    const mbm_registers view = {words, 0, 2, MBM_REGISTERS_OF_WORDS, MBM_ORDER_ABCD};
    union {
        uint32_t bits;
        float number;
    } value = {0x7FC00000u};

    (void)mbm_registers_getUint32(&view, 0, order, &value.bits);
    return value.number;
}

/**
 * As mbm_words_getUint32, for a number of one word. Without swapped bytes it is the word itself.
 *
 * @return the number; 0 if `words` is NULL or there is no such order
 */
static inline uint16_t mbm_words_getUint16(const uint16_t *words, uint8_t order)
{
    const mbm_registers view = {words, 0, 1, MBM_REGISTERS_OF_WORDS, MBM_ORDER_ABCD};
    uint16_t number = 0;

    (void)mbm_registers_getUint16(&view, 0, order, &number);
    return number;
}

/**
 * As mbm_words_getUint16, with a sign, in two's complement.
 *
 * @return the number; 0 if `words` is NULL or there is no such order
 */
static inline int16_t mbm_words_getInt16(const uint16_t *words, uint8_t order)
{
    const mbm_registers view = {words, 0, 1, MBM_REGISTERS_OF_WORDS, MBM_ORDER_ABCD};
    int16_t number = 0;

    (void)mbm_registers_getUint16(&view, 0, order, (uint16_t *)&number);
    return number;
}

/**
 * As mbm_words_getUint32, for a number of four words.
 *
 * @return the number; 0 if `words` is NULL or there is no such order
 */
static inline uint64_t mbm_words_getUint64(const uint16_t *words, uint8_t order)
{
    const mbm_registers view = {words, 0, 4, MBM_REGISTERS_OF_WORDS, MBM_ORDER_ABCD};
    uint64_t number = 0;

    (void)mbm_registers_getUint64(&view, 0, order, &number);
    return number;
}

/**
 * As mbm_words_getUint64, with a sign, in two's complement.
 *
 * @return the number; 0 if `words` is NULL or there is no such order
 */
static inline int64_t mbm_words_getInt64(const uint16_t *words, uint8_t order)
{
    const mbm_registers view = {words, 0, 4, MBM_REGISTERS_OF_WORDS, MBM_ORDER_ABCD};
    int64_t number = 0;

    (void)mbm_registers_getUint64(&view, 0, order, (uint64_t *)&number);
    return number;
}

/**
 * As mbm_words_getUint64, for a double of four words, an IEEE 754 binary64; see
 * mbm_registers_getDouble.
 *
 * @return the number; a NaN if `words` is NULL or there is no such order
 */
static inline double mbm_words_getDouble(const uint16_t *words, uint8_t order)
{
    const mbm_registers view = {words, 0, 4, MBM_REGISTERS_OF_WORDS, MBM_ORDER_ABCD};
    const union {
        uint32_t bits;
        float number;
    } none = {0x7FC00000u};
    double number = (double)none.number;

    (void)mbm_registers_getDouble(&view, 0, order, &number);
    return number;
}

/**
 * Writes a number into two words of yours, for example the transmit words of mbm_node.
 *
 * @param words   the first of them
 * @param order   one of MBM_ORDER_...; MBM_ORDER_DEFAULT for MBM_ORDER_ABCD
 * @param number  the number
 * @return a status; MBM_NOT_INITIALISED if `words` is NULL
 */
static inline uint8_t mbm_words_setUint32(uint16_t *words, uint8_t order, uint32_t number)
{
    const mbm_registers view = {words, 0, 2, MBM_REGISTERS_INTO_WORDS, MBM_ORDER_ABCD};

    return mbm_registers_setUint32(&view, 0, order, number);
}

/** As mbm_words_setUint32, with a sign, in two's complement. */
static inline uint8_t mbm_words_setInt32(uint16_t *words, uint8_t order, int32_t number)
{
    return mbm_words_setUint32(words, order, (uint32_t)number);
}

/** As mbm_words_setUint32, for a number of one word. */
static inline uint8_t mbm_words_setUint16(uint16_t *words, uint8_t order, uint16_t number)
{
    const mbm_registers view = {words, 0, 1, MBM_REGISTERS_INTO_WORDS, MBM_ORDER_ABCD};

    return mbm_registers_setUint16(&view, 0, order, number);
}

/** As mbm_words_setUint32, for a number of one word with a sign. */
static inline uint8_t mbm_words_setInt16(uint16_t *words, uint8_t order, int16_t number)
{
    return mbm_words_setUint16(words, order, (uint16_t)number);
}

/** As mbm_words_setUint32, for a float, an IEEE 754 binary32. Its bits are copied. */
static inline uint8_t mbm_words_setFloat(uint16_t *words, uint8_t order, float number)
{
    const mbm_registers view = {words, 0, 2, MBM_REGISTERS_INTO_WORDS, MBM_ORDER_ABCD};

    return mbm_registers_setFloat(&view, 0, order, &number);
}

/** As mbm_words_setUint32, for a number of four words. */
static inline uint8_t mbm_words_setUint64(uint16_t *words, uint8_t order, uint64_t number)
{
    const mbm_registers view = {words, 0, 4, MBM_REGISTERS_INTO_WORDS, MBM_ORDER_ABCD};

    return mbm_registers_setUint64(&view, 0, order, &number);
}

/** As mbm_words_setUint32, for a double of four words, an IEEE 754 binary64. */
static inline uint8_t mbm_words_setDouble(uint16_t *words, uint8_t order, double number)
{
    const mbm_registers view = {words, 0, 4, MBM_REGISTERS_INTO_WORDS, MBM_ORDER_ABCD};

    return mbm_registers_setDouble(&view, 0, order, &number);
}

/** As mbm_words_setUint64, with a sign, in two's complement. */
static inline uint8_t mbm_words_setInt64(uint16_t *words, uint8_t order, int64_t number)
{
    return mbm_words_setUint64(words, order, (uint64_t)number);
}

/**
 * Reads a text up to its first NUL or the end of its field, as mbm_registers_getString.
 *
 * @param words     the first of its words, of which there must be enough
 * @param order     one of MBM_ORDER_...; MBM_ORDER_DEFAULT for MBM_ORDER_ABCD
 * @param length    length of the field in bytes, two for each word
 * @param text      receives the text and a NUL
 * @param capacity  size of `text` in bytes; `length + 1` are always enough
 * @return a status; MBM_BUFFER_TOO_SMALL if `text` is; MBM_NOT_INITIALISED if `words` is NULL
 */
static inline uint8_t mbm_words_getString(const uint16_t *words, uint8_t order, uint16_t length,
                                          char *text, uint16_t capacity)
{
    /* As many words as `length` may name. */
    const mbm_registers view = {words, 0, 32768u, MBM_REGISTERS_OF_WORDS, MBM_ORDER_ABCD};

    return mbm_registers_getString(&view, 0, length, order, text, capacity);
}

/**
 * Writes a text into a field, followed by NULs, as mbm_registers_setString.
 *
 * @param words   the first of its words, of which there must be enough
 * @param order   one of MBM_ORDER_...; MBM_ORDER_DEFAULT for MBM_ORDER_ABCD
 * @param length  length of the field in bytes, two for each word
 * @param text    the text; a NUL ends it, for which the field needs no space
 * @return a status; MBM_BUFFER_TOO_SMALL if the field is; MBM_NOT_INITIALISED if `words` is NULL
 */
static inline uint8_t mbm_words_setString(uint16_t *words, uint8_t order, uint16_t length,
                                          const char *text)
{
    /* As many words as `length` may name. */
    const mbm_registers view = {words, 0, 32768u, MBM_REGISTERS_INTO_WORDS, MBM_ORDER_ABCD};

    return mbm_registers_setString(&view, 0, length, order, text);
}
