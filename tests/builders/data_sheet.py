"""A small electronic data sheet (EDS) in the style of a vendor."""

from __future__ import annotations

from config.formats.eds import ElectronicDataSheet, parse_eds

SHEET = """[FileInfo]
FileName=drive.eds

[DeviceInfo]
VendorName=A vendor
VendorNumber=0x000000FB
ProductName=A drive
ProductNumber=1617
RevisionNumber=0x01700000
NrOfRXPDO=4

[Comments]
Lines=1
Line1=anything may stand here

[1000]
ParameterName=Device type
ObjectType=0x7
DataType=0x0007
AccessType=ro
DefaultValue=0x00020192
PDOMapping=0

[1018]
ParameterName=Identity
ObjectType=0x9
SubNumber=2

[1018sub0]
ParameterName=Number of entries
DataType=0x0005
AccessType=const
DefaultValue=4

[1018sub1]
ParameterName=Vendor
DataType=0x0007
AccessType=ro

[1400sub1]
ParameterName=COB-ID
DataType=0x0007
AccessType=rw
DefaultValue=$NODEID+0x200
LowLimit=0x00000181
HighLimit=0xFFFFFFFF

[6077]
ParameterName=Torque actual value
DataType=0x0003
AccessType=ro
PDOMapping=1
LowLimit=0x8000
HighLimit=32767
"""


def read(text: str) -> ElectronicDataSheet:
    return parse_eds(text.encode(), "drive.eds")
