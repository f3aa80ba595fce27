/**
 * @file ModbusMasterBoards.h
 * @brief The boards that the archive at hand serves: here, whichever you link.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusMaster.h and ModbusServer.h.
 * In the Arduino library, `make arduino` puts a file in this one's place that
 * stops the build on boards for which the library has no code.
 */
