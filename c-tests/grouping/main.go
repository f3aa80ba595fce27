// Groups the tables of c-tests/test_plan_grouping.c with go-modbus-client's DefaultSplitter, and
// prints the rows of c-tests/grouping/expected.h.
//
// It needs Go and go-modbus-client (MIT), which `make test` does not. To write the file again:
// put this file into a folder `grouping` of an unpacked go-modbus-client, and call there
// `go run ./grouping >expected.h`. The rows in this repository are of release 0.5.0, commit
// a694d7c593b2.
package main

import (
	"fmt"

	modbus "github.com/aldas/go-modbus-client"
)

const tables = 100

// random returns numbers below `limit`, the same as the test in C.
type random uint32

func (r *random) below(limit uint32) uint32 {
	*r = *r*1664525 + 1013904223
	return uint32(*r) >> 16 % limit
}

func fields(number uint32) modbus.Fields {
	r := random(number)
	counts := []uint32{5, 10, 20, 50, 100, 200, 500, 1000}
	count := counts[r.below(8)]
	spread := 2 + r.below(20)
	server := "tcp://device:502?max_quantity_per_request=" + fmt.Sprint(20+r.below(106))
	if r.below(3) == 0 {
		server += "&invalid_addr=300-319"
	}
	isBits := r.below(4) == 0
	var table modbus.Fields
	for i := uint32(0); i < count; i++ {
		shape := r.below(8)
		field := modbus.Field{
			ServerAddress: server,
			Protocol:      modbus.ProtocolTCP,
			UnitID:        uint8(1 + r.below(3)),
			Address:       uint16(r.below(count * spread)),
		}
		characters := 8 * (1 + r.below(4))
		if field.Address > 319 || field.Address < 280 {
			table = append(table, typed(field, shape, characters, isBits))
		}
	}
	return table
}

// typed gives the field a function and a type.
func typed(field modbus.Field, shape, characters uint32, isBits bool) modbus.Field {
	if isBits {
		field.FunctionCode = 1
		field.Type = modbus.FieldTypeCoil
		return field
	}
	field.FunctionCode = 3
	switch shape {
	case 0, 1:
		field.Type = modbus.FieldTypeFloat32
	case 2:
		field.Type = modbus.FieldTypeFloat64
	case 3:
		field.Type = modbus.FieldTypeString
		field.Length = uint8(characters)
	case 4, 5:
		field.Type = modbus.FieldTypeBit
		field.Bit = uint8(characters / 8)
	default:
		field.Type = modbus.FieldTypeUint16
	}
	return field
}

func main() {
	fmt.Println("/* Written by main.go, from go-modbus-client. */\n/* clang-format off */")
	for number := uint32(0); number < tables; number++ {
		requests, err := modbus.DefaultSplitter{}.Split(fields(number), 0, 0)
		if err != nil {
			panic(err)
		}
		quantity := 0
		for _, request := range requests {
			quantity += int(request.Quantity)
		}
		fmt.Printf("{%d, %d},\n", len(requests), quantity)
	}
}
