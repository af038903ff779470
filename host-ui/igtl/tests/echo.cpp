// Reads messages from standard input with libOpenIGTLink, builds each anew from what it says, and writes that to standard output.
// Build: g++ -I/usr/include/openigtlink echo.cpp -lOpenIGTLink -lpthread
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>
#include <igtlImageMessage.h>
#include <igtlMessageHeader.h>
#include <igtlPointMessage.h>
#include <igtlPolyDataMessage.h>
#include <igtlStatusMessage.h>
#include <igtlStringMessage.h>
#include <igtlTransformMessage.h>

static void fail(const char* what) {
    fprintf(stderr, "%s\n", what);
    exit(1);
}

/// Header and body into a message of its type, with its checksum verified.
template <class M> static typename M::Pointer read(igtl::MessageHeader* header, const std::vector<unsigned char>& body) {
    typename M::Pointer message = M::New();
    message->SetMessageHeader(header);
    message->AllocatePack();
    if (message->GetPackBodySize() != body.size()) fail("length of a body");
    memcpy(message->GetPackBodyPointer(), body.data(), body.size());
    if (!(message->Unpack(1) & igtl::MessageHeader::UNPACK_BODY)) fail(header->GetDeviceType());
    return message;
}

static void write(igtl::MessageHeader* header, igtl::MessageBase* message) {
    unsigned int seconds, fraction;
    header->GetTimeStamp(&seconds, &fraction);
    message->SetDeviceName(header->GetDeviceName());
    message->SetTimeStamp(seconds, fraction);
    message->Pack();
    fwrite(message->GetPackPointer(), 1, message->GetPackSize(), stdout);
}

static void transform(igtl::MessageHeader* header, const std::vector<unsigned char>& body) {
    igtl::TransformMessage::Pointer in = read<igtl::TransformMessage>(header, body), out = igtl::TransformMessage::New();
    igtl::Matrix4x4 m;
    in->GetMatrix(m);
    out->SetMatrix(m);
    write(header, out);
}

static void points(igtl::MessageHeader* header, const std::vector<unsigned char>& body) {
    igtl::PointMessage::Pointer in = read<igtl::PointMessage>(header, body), out = igtl::PointMessage::New();
    for (int i = 0; i < in->GetNumberOfPointElement(); i++) {
        igtl::PointElement::Pointer from, to = igtl::PointElement::New();
        in->GetPointElement(i, from);
        igtlUint8 rgba[4];
        igtlFloat32 place[3];
        from->GetRGBA(rgba);
        from->GetPosition(place);
        to->SetName(from->GetName());
        to->SetGroupName(from->GetGroupName());
        to->SetRGBA(rgba);
        to->SetPosition(place);
        to->SetRadius(from->GetRadius());
        to->SetOwner(from->GetOwner());
        out->AddPointElement(to);
    }
    write(header, out);
}

static void polydata(igtl::MessageHeader* header, const std::vector<unsigned char>& body) {
    igtl::PolyDataMessage::Pointer in = read<igtl::PolyDataMessage>(header, body), out = igtl::PolyDataMessage::New();
    igtl::PolyDataPointArray::Pointer places = igtl::PolyDataPointArray::New();
    igtl::PolyDataCellArray::Pointer cells = igtl::PolyDataCellArray::New();
    for (int i = 0; i < in->GetPoints()->GetNumberOfPoints(); i++) {
        igtlFloat32 place[3];
        in->GetPoints()->GetPoint(i, place);
        places->AddPoint(place);
    }
    for (unsigned int i = 0; i < in->GetPolygons()->GetNumberOfCells(); i++) {
        igtlUint32 corners[3];
        if (in->GetPolygons()->GetCellSize(i) != 3) fail("a cell that is no triangle");
        in->GetPolygons()->GetCell(i, corners);
        cells->AddCell(3, corners);
    }
    out->SetPoints(places);
    out->SetPolygons(cells);
    write(header, out);
}

static void image(igtl::MessageHeader* header, const std::vector<unsigned char>& body) {
    igtl::ImageMessage::Pointer in = read<igtl::ImageMessage>(header, body), out = igtl::ImageMessage::New();
    int size[3];
    float spacing_mm[3];
    igtl::Matrix4x4 m;
    in->GetDimensions(size);
    in->GetSpacing(spacing_mm);
    in->GetMatrix(m);
    out->SetDimensions(size);
    out->SetSpacing(spacing_mm);
    out->SetScalarType(in->GetScalarType());
    out->SetCoordinateSystem(in->GetCoordinateSystem());
    out->SetMatrix(m);
    out->AllocateScalars();
    memcpy(out->GetScalarPointer(), in->GetScalarPointer(), in->GetImageSize());
    write(header, out);
}

static void status(igtl::MessageHeader* header, const std::vector<unsigned char>& body) {
    igtl::StatusMessage::Pointer in = read<igtl::StatusMessage>(header, body), out = igtl::StatusMessage::New();
    out->SetCode(in->GetCode());
    out->SetSubCode(in->GetSubCode());
    out->SetErrorName(in->GetErrorName());
    out->SetStatusString(in->GetStatusString());
    write(header, out);
}

static void text(igtl::MessageHeader* header, const std::vector<unsigned char>& body) {
    igtl::StringMessage::Pointer in = read<igtl::StringMessage>(header, body), out = igtl::StringMessage::New();
    out->SetEncoding(in->GetEncoding());
    out->SetString(in->GetString());
    write(header, out);
}

int main() {
    for (;;) {
        igtl::MessageHeader::Pointer header = igtl::MessageHeader::New();
        header->InitPack();
        if (fread(header->GetPackPointer(), 1, header->GetPackSize(), stdin) != (size_t)header->GetPackSize()) return 0;
        header->Unpack();
        std::vector<unsigned char> body(header->GetBodySizeToRead());
        if (fread(body.data(), 1, body.size(), stdin) != body.size()) fail("a body that ends too early");
        const std::string type = header->GetDeviceType();
        if (type == "TRANSFORM") transform(header, body);
        else if (type == "POINT") points(header, body);
        else if (type == "POLYDATA") polydata(header, body);
        else if (type == "IMAGE") image(header, body);
        else if (type == "STATUS") status(header, body);
        else if (type == "STRING") text(header, body);
        else fail(type.c_str());
    }
}
