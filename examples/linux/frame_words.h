/**
 * @file frame_words.h
 * @brief Explains an RTU frame in one line of words.
 *
 * Licence: MIT OR Apache-2.0.
 */
#ifndef FRAME_WORDS_H
#define FRAME_WORDS_H

#include <stddef.h>
#include <stdint.h>

/** Which way a frame goes; the same bytes mean different things each way. */
typedef enum frame_direction { FRAME_REQUEST, FRAME_REPLY } frame_direction;

/**
 * Explains a frame: unit, function, what it asks or brings, and whether its CRC
 * is right.
 *
 * @param text       receives the line, without a newline; cut off if too long
 * @param size       bytes of text, at least 1
 * @param direction  request or reply
 * @param frame      unit, PDU and CRC
 * @param length     bytes of frame
 */
void frame_words(char *text, size_t size, frame_direction direction, const uint8_t *frame,
                 size_t length);

#endif
