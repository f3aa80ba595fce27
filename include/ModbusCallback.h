/**
 * @file ModbusCallback.h
 * @brief Holds a function, or a lambda with captures, without a heap.
 *
 * Licence: MIT OR Apache-2.0. Included by ModbusClient.h and ModbusSniffer.h.
 *
 * A macro that may be defined before, the same in every file of a program:
 * - MODBUS_CAPTURE_BYTES  bytes for the captures of one callback; on AVR 4, which hold
 *   two references or pointers, else as many as four pointers have. A lambda that captures
 *   more does not compile.
 */

#ifndef MODBUSCALLBACK_H
#define MODBUSCALLBACK_H

#include <stddef.h>
#include <stdint.h>

/** @cond the macro is explained at the head of the file */
#if !defined(MODBUS_CAPTURE_BYTES)
#if defined(__AVR__)
#define MODBUS_CAPTURE_BYTES 4
#else
#define MODBUS_CAPTURE_BYTES (4 * sizeof(void *))
#endif
#endif

// Not every core has <new>, so this is a placement new of our own.
struct ModbusPlace {
    void *address;
};
inline void *operator new(size_t, ModbusPlace place) noexcept
{
    return place.address;
}
inline void operator delete(void *, ModbusPlace) noexcept {}
/** @endcond */

/**
 * A callback with an `Argument`; none at first.
 *
 * It holds a function, or a lambda that captures numbers, pointers and references. The
 * captures are copied. An object that a lambda refers to must exist for as long as
 * the callback may be called.
 */
template <typename Argument> class ModbusCallback {
public:
    ModbusCallback() : invoke(nullptr), storage() {}

    /** Sets a function; nullptr for none. */
    void set(void (*function)(Argument &))
    {
        if (function != nullptr)
            keep(function);
        else
            invoke = nullptr;
    }
    /** Sets a lambda. */
    template <typename Function> void set(const Function &function) { keep(function); }
    /** Removes the callback. */
    void set(decltype(nullptr)) { invoke = nullptr; }

    /** Whether a callback is set. */
    bool isSet() const { return invoke != nullptr; }

    /** Calls it. The callback may set another one in its place. */
    void operator()(Argument &argument) const
    {
        if (invoke != nullptr)
            invoke(storage.bytes, argument);
    }

private:
    union Storage {
        void *pointer;
        uint32_t word;
        unsigned char bytes[MODBUS_CAPTURE_BYTES];
    };

    void (*invoke)(const unsigned char *, Argument &);
    Storage storage;

    template <typename Function> void keep(const Function &function)
    {
        static_assert(sizeof(Function) <= sizeof(Storage),
                      "this lambda captures more than MODBUS_CAPTURE_BYTES");
        static_assert(alignof(Function) <= alignof(Storage), "a capture needs a larger alignment");
#if defined(__GNUC__) && !defined(__clang__) && __GNUC__ < 5
        static_assert(__has_trivial_copy(Function) && __has_trivial_destructor(Function),
                      "captures are numbers, pointers and references");
#else
        static_assert(__is_trivially_copyable(Function),
                      "captures are numbers, pointers and references");
#endif
        new (ModbusPlace{storage.bytes}) Function(function);
        invoke = call<Function>;
    }

    template <typename Function> static void call(const unsigned char *bytes, Argument &argument)
    {
        // A copy, because the callback may set another one in its place.
        const Function function(*reinterpret_cast<const Function *>(
            static_cast<const void *>(bytes)));
        function(argument);
    }
};

#endif
