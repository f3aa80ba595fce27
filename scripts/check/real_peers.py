"""The kits modbus-esp8266, eModbus and esp-modbus of scripts/check/real: other libraries, whose programs docs/porting-from-esp-libraries.md
shows beside ours.

The blocks of the page that name the library are compiled with its headers: for an Uno with the real core, if it runs there; else for
this machine, with the headers of the chip's SDK played. Nothing is linked."""
import re

PAGE = "docs/porting-from-esp-libraries.md"
CORE = "/usr/share/arduino/hardware/arduino/avr"
UNO = ["avr-g++", "-mmcu=atmega328p", "-DF_CPU=16000000L", "-DARDUINO=10819", "-DARDUINO_AVR_UNO", "-DARDUINO_UNO", "-std=gnu++11", "-Os",
       "-I", f"{CORE}/cores/arduino", "-I", f"{CORE}/variants/standard"]
KERNEL = ("typedef void *TaskHandle_t; typedef void *QueueHandle_t; typedef void *SemaphoreHandle_t; typedef void *EventGroupHandle_t;\n"
          "typedef unsigned EventBits_t; typedef unsigned TickType_t; typedef int BaseType_t; typedef unsigned UBaseType_t;\n"
          "#define pdMS_TO_TICKS(ms) ((TickType_t)(ms))\n"
          "void vTaskDelay(TickType_t ticks);\n")
# What the headers of eModbus take from an ESP32's core.
ARDUINO = {
    "Arduino.h": "#pragma once\n#include <cstdint>\n#include <cstddef>\n#include <cstring>\n#include <functional>\nusing std::size_t;\n"
                 "enum { SERIAL_8N1, SERIAL_8E1, OUTPUT, A0 };\n"
                 "struct Print { virtual size_t write(uint8_t byte) = 0; };\n"
                 "struct Stream : Print { virtual int available() = 0; virtual int read() = 0; virtual void flush() = 0; };\n"
                 "struct HardwareSerial : Stream { void begin(unsigned long rate, uint32_t form); size_t setRxBufferSize(size_t); size_t setTxBufferSize(size_t);\n"
                 "    uint32_t baudRate(); size_t write(uint8_t) override; int available() override; int read() override; void flush() override; };\n"
                 "extern HardwareSerial Serial, Serial1;\nunsigned long millis(); unsigned long micros(); void delay(unsigned long ms);\n"
                 "void pinMode(uint8_t pin, uint8_t mode); void digitalWrite(uint8_t pin, uint8_t level); int analogRead(uint8_t pin);\n",
    "Stream.h": "#include <Arduino.h>\n",
    "freertos/FreeRTOS.h": f"#pragma once\n{KERNEL}",
    "freertos/task.h": "",
}
# What those of esp-modbus take from ESP-IDF.
IDF = {
    "sdkconfig.h": "#define CONFIG_FMB_EXT_TYPE_SUPPORT 1\n#define CONFIG_FMB_COMM_MODE_RTU_EN 1\n#define CONFIG_FMB_COMM_MODE_ASCII_EN 1\n"
                   "#define CONFIG_FMB_PORT_TASK_PRIO 10\n#define CONFIG_FMB_CONTROLLER_STACK_SIZE 4096\n"
                   "#define CONFIG_FMB_PORT_TASK_STACK_SIZE 4096\n#define CONFIG_FMB_MASTER_TIMEOUT_MS_RESPOND 3000\n",
    "soc/soc.h": "#pragma once\n" + "".join(f"#define BIT{bit} (1UL << {bit})\n" for bit in range(16)),
    "spinlock.h": "#include <sys/types.h>\ntypedef int _lock_t;\ntypedef struct { int owner; } spinlock_t;\n",
    "freertos/FreeRTOS.h": f"#pragma once\n#include <assert.h>\n#include <stdint.h>\n#include \"soc/soc.h\"\n{KERNEL}typedef struct {{ int owner; }} portMUX_TYPE;\n",
    **{f"freertos/{name}.h": '#include "freertos/FreeRTOS.h"\n' for name in ("task", "queue", "event_groups", "semphr", "portmacro")},
    "esp_err.h": "#pragma once\ntypedef int esp_err_t;\nenum { ESP_OK = 0, ESP_FAIL = -1 };\n"
                 "#define ESP_ERROR_CHECK(call) do { if ((call) != ESP_OK) for (;;) ; } while (0)\n",
    "esp_log.h": "#pragma once\n#define ESP_LOGE(...)\n",
    "esp_check.h": "#pragma once\n#include \"esp_err.h\"\n#define ESP_RETURN_ON_FALSE(a, code, ...) do { if (!(a)) return code; } while (0)\n",
    "driver/uart.h": "#pragma once\n#include \"esp_err.h\"\n"
                     "typedef enum { UART_NUM_0, UART_NUM_1 } uart_port_t; typedef enum { UART_DATA_8_BITS = 3 } uart_word_length_t;\n"
                     "typedef enum { UART_STOP_BITS_1 = 1, UART_STOP_BITS_2 = 3 } uart_stop_bits_t;\n"
                     "typedef enum { UART_PARITY_DISABLE, UART_PARITY_EVEN = 2 } uart_parity_t;\n"
                     "typedef enum { UART_MODE_UART, UART_MODE_RS485_HALF_DUPLEX } uart_mode_t;\nenum { UART_PIN_NO_CHANGE = -1 };\n"
                     "esp_err_t uart_set_pin(uart_port_t uart, int tx, int rx, int rts, int cts);\n"
                     "esp_err_t uart_set_mode(uart_port_t uart, uart_mode_t mode);\n",
}


def programs(kit) -> dict:
    """The programs of the page for the library, {name: text}."""
    found = {}
    for text in re.findall(r"^```(?:c|cpp)\n(.*?)^```", (kit.root / PAGE).read_text(encoding="utf-8"), re.M | re.S):
        named = re.match(rf"(?://|/\*) ([\w-]+\.(?:ino|c)): {re.escape(kit.kind)}\b", text)
        if named:
            found[named[1]] = text
    if not found:
        kit.fail(f"{PAGE} has no program for {kit.kind}")
    return found


def headers(kit, files: dict) -> list:
    for name, text in files.items():
        path = kit.work / "played" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return ["-I", kit.work / "played"]


def check(kit) -> None:
    tree = kit.tree
    if kit.kind == "modbus-esp8266":
        begin, command = "#include <Arduino.h>\n", [*UNO, "-I", kit.there(tree / "src")]
    elif kit.kind == "eModbus":
        begin = "#include <Arduino.h>\n"
        command = ["g++", "-std=c++17", "-DESP32", *headers(kit, ARDUINO), "-I", kit.there(tree / "src")]
    else:
        begin = ""
        folders = sorted({path.parent for path in kit.there(tree / "modbus").rglob("*.h")})
        command = ["gcc", "-std=gnu17", *headers(kit, IDF), *(word for folder in folders for word in ("-I", folder))]
    for name, text in programs(kit).items():
        source = kit.work / f"{name}{'pp' if name.endswith('.ino') else ''}".replace(".inopp", ".cpp")
        source.write_text(begin + text)
        kit.run(kit.work / "build.log", [*command, "-w", "-Werror=implicit-function-declaration", "-c", source, "-o", f"{source}.o"])
        print(f"real: {kit.kind}: {name} of {PAGE} compiles")
